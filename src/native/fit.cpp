// The fit's inner loop: 1/ESS of a mixture at many viewer angles, with the gradient and the Gauss-Newton matrix in the
// lobes' own parameters.
//
// With q and p densities in d theta d phi, 1/ESS - 1 = ∫ q²/p - 1 = ∫ (q - p)²/p: a sum of squares of
// r = (q - p)/√p, so minimising 1/ESS itself is a least-squares problem.
#include "arrays.h"
#include "bindings.h"
#include "families.h"

#include "cuticle/sampler/lobes.h"

#include <nanobind/stl/string.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>
#include <vector>

namespace native {
namespace {

// One lobe's density along one coordinate at `count` points, and its derivatives by mean and sigma. With z = (x - mean) rate
// and s the family's shape the density is rate s(z) over ∫ s dz from one end to the other; ends that move with the mean, as
// a period's do, add nothing to its derivative.
template <class Family>
void with_derivatives(double mean, double sigma, double lo, double hi, bool moving, const double *x, std::size_t count,
                      double *value, double *by_mean, double *by_sigma) {
    const auto d = Family::make(mean, sigma, lo, hi);
    const double norm = cuticle::density_norm<Family>(d), rate = d.rate;
    const double za = (lo - mean) * rate, zb = (hi - mean) * rate;
    const double fa = norm * Family::shape(za), fb = norm * Family::shape(zb);  // density at the ends
    const double from_ends = moving ? 0 : fb - fa;
    for (std::size_t i = 0; i < count; ++i) {
        const double z = (x[i] - mean) * rate, fall = Family::fall(z);
        value[i] = norm * Family::shape(z);
        by_mean[i] = value[i] * (fall * rate + from_ends);
        by_sigma[i] = value[i] * ((fall * z - 1) / sigma + (zb * fb - za * fa) / Family::deviation);
    }
}

// The three factors a lobe has along a coordinate, value and derivatives by mean and sigma, and which of theta's and of
// phi's each parameter's derivative of the density is the product of.
enum Factor { value_of, by_mean, by_sigma, factors };
struct Parameter {
    cuticle::LobeParameter parameter;
    Factor theta, phi;
};
constexpr Parameter products[] = {{cuticle::lobe_weight, value_of, value_of},
                                  {cuticle::lobe_mean_theta, by_mean, value_of},
                                  {cuticle::lobe_mean_phi, value_of, by_mean},
                                  {cuticle::lobe_sigma_theta, by_sigma, value_of},
                                  {cuticle::lobe_sigma_phi, value_of, by_sigma}};

// Rows and columns whose sums the registers hold.
constexpr std::size_t abreast = CUTICLE_VECTOR_BYTES == 64 ? 8 : 4, wide = 8;

constexpr std::size_t whole(std::size_t count, std::size_t of) { return (count + of - 1) / of * of; }

// out (abreast, columns) = left (abreast, inner) right (inner, columns); columns come in multiples of `wide`.
void multiply(const double *left, const double *right, std::size_t inner, std::size_t columns, double *out) {
    for (std::size_t c = 0; c < columns; c += wide) {
        using Lanes = cuticle::Pack<double, wide, CUTICLE_VECTOR_BYTES>;
        Lanes sum[abreast];
        for (Lanes &s : sum) s = Lanes(0);
        for (std::size_t b = 0; b < inner; ++b) {
            const Lanes r = cuticle::load_pack<double, wide, Lanes>(right + b * columns + c);
            for (std::size_t i = 0; i < abreast; ++i) sum[i] = sum[i] + Lanes(left[i * inner + b]) * r;
        }
        for (std::size_t i = 0; i < abreast; ++i)
            for (std::size_t n = 0; n < wide; ++n) out[i * columns + c + n] = sum[i][static_cast<int>(n)];
    }
}

// What is minimised, of E viewer angles: q (E, A, B), its grid theta (E, A) and phi (E, B) with quadrature weights, and
// parameters (E, lobe_parameters, K).
struct Problem {
    const In<double> &q, &theta, &theta_weight, &phi, &phi_weight, &parameters;
    bool even;
    double allowed, price;
};

// The loss of one viewer angle after another, ½ ∫ (q - p)²/p + ½ price mean of ln²(q/(allowed p)) where q > allowed p, with
// its gradient (P) and Gauss-Newton matrix (P, P), P = lobe_parameters K.
//
// The first term hardly sees how large q/p gets where q is small. The second bounds it: by its logarithm, which for lobes of
// normals is a polynomial of their parameters, and linearly from `steepest` on, so that no far point rules the rest.
//
// Each parameter's derivative is a product of a function of theta and one of phi, of which there are only 3 K. The sums over
// phi are made for those 3 K and their products, a few thetas at a time, and spread over the P parameters theta by theta.
template <class Family> class NormalEquations {
  public:
    explicit NormalEquations(const Problem &problem_) : problem(problem_) {
        for (const Parameter &d : products)
            for (std::size_t k = 0; k < lobes; ++k)
                kind[d.parameter * lobes + k] = static_cast<std::size_t>(d.phi) * lobes + k;
    }

    double loss(std::size_t e) {
        start(e);
        double total = 0;
        for (std::size_t a = 0; a < na; ++a) total += residuals(a, slope.data(), curvature.data());
        return total;
    }

    double loss(std::size_t e, double *gradient, double *hessian) {
        start(e);
        multiply_factors();
        std::fill(gradient, gradient + size, 0.);
        std::fill(hessian, hessian + size * size, 0.);
        double total = 0;
        for (std::size_t a = 0; a < na; a += abreast) {
            const std::size_t count = std::min(abreast, na - a);
            for (std::size_t i = 0; i < count; ++i) total += residuals(a + i, &slope[i * nb_], &curvature[i * nb_]);
            multiply(slope.data(), single.data(), nb_, singles, first.data());
            multiply(curvature.data(), pair.data(), nb_, pairs, packed.data());
            for (std::size_t i = 0; i < count; ++i)
                spread(a + i, &first[i * singles], &packed[i * pairs], gradient, hessian);
        }
        for (std::size_t j = 0; j < size; ++j)
            for (std::size_t l = j + 1; l < size; ++l) hessian[j * size + l] = hessian[l * size + j];
        return total;
    }

  private:
    static constexpr double least = 1e-30;  // keeps q²/p finite where every lobe has died out
    static constexpr double steepest = 3;

    const Problem &problem;
    const std::size_t na = problem.q.shape(1), nb_ = problem.q.shape(2), lobes = problem.parameters.shape(2);
    const std::size_t size = cuticle::lobe_parameters * lobes, kinds = factors * lobes;
    const std::size_t singles = whole(kinds, wide), pairs = whole(kinds * (kinds + 1) / 2, wide);
    using Values = std::vector<double>;
    // Factors by theta and by phi, [factor][lobe][point]; those by phi and their products by point: [point][pair].
    Values by_theta = Values(kinds * na), by_phi = Values(kinds * nb_), single = Values(nb_ * singles);
    Values pair = Values(nb_ * pairs), wrapped = Values(nb_), p = Values(nb_);
    Values slope = Values(abreast * nb_), curvature = Values(abreast * nb_);
    Values first = Values(abreast * singles), packed = Values(abreast * pairs), second = Values(kinds * kinds);
    Values scale = Values(size);
    std::vector<std::size_t> kind = std::vector<std::size_t>(size);  // which factor by phi each parameter has
    // Of the viewer angle: its parameters, target and weights, and what a point's weight is of the second term's.
    const double *x = nullptr, *target = nullptr, *row_weights = nullptr, *column_weights = nullptr;
    double share = 0;

    void start(std::size_t e) {
        x = problem.parameters.data() + e * size;
        target = problem.q.data() + e * na * nb_;
        row_weights = problem.theta_weight.data() + e * na;
        column_weights = problem.phi_weight.data() + e * nb_;
        share = problem.price / (std::accumulate(row_weights, row_weights + na, 0.) *
                                 std::accumulate(column_weights, column_weights + nb_, 0.));
        const double *thetas = problem.theta.data() + e * na, *phis = problem.phi.data() + e * nb_;
        const double pi = cuticle::pi<double>;
        for (std::size_t k = 0; k < lobes; ++k) {
            const auto of = [&](cuticle::LobeParameter parameter) { return x[parameter * lobes + k]; };
            const auto part = [&](Values &to, Factor factor, std::size_t points) {
                return &to[(factor * lobes + k) * points];
            };
            with_derivatives<Family>(of(cuticle::lobe_mean_theta), of(cuticle::lobe_sigma_theta), -cuticle::half_pi<double>,
                                     cuticle::half_pi<double>, false, thetas, na, part(by_theta, value_of, na),
                                     part(by_theta, by_mean, na), part(by_theta, by_sigma, na));
            const double mean = of(cuticle::lobe_mean_phi);
            const bool even = problem.even;
            for (std::size_t b = 0; b < nb_; ++b)
                wrapped[b] = even ? phis[b] : mean + cuticle::math::wrap_angle(phis[b] - mean);
            with_derivatives<Family>(mean, of(cuticle::lobe_sigma_phi), even ? 0 : mean - pi, even ? pi : mean + pi, !even,
                                     wrapped.data(), nb_, part(by_phi, value_of, nb_), part(by_phi, by_mean, nb_),
                                     part(by_phi, by_sigma, nb_));
        }
    }

    void multiply_factors() {
        for (std::size_t b = 0; b < nb_; ++b) {
            double *g = &single[b * singles], *product = &pair[b * pairs];
            for (std::size_t m = 0; m < kinds; ++m) g[m] = by_phi[m * nb_ + b];
            for (std::size_t m = 0; m < kinds; product += ++m)
                for (std::size_t n = 0; n <= m; ++n) product[n] = g[m] * g[n];
        }
    }

    // The loss of theta `a`, with the derivatives' factors.
    double residuals(std::size_t a, double *slopes, double *curvatures) {
        std::fill(p.begin(), p.end(), least);
        for (std::size_t k = 0; k < lobes; ++k) {
            const double w = x[k] * by_theta[k * na + a];
            for (std::size_t b = 0; b < nb_; ++b) p[b] += w * by_phi[k * nb_ + b];
        }
        double sum = 0;
        for (std::size_t b = 0; b < nb_; ++b) {
            const double r = target[a * nb_ + b] / p[b], weight = row_weights[a] * column_weights[b];
            sum += .5 * weight * (r - 1) * (r - 1) * p[b];
            slopes[b] = -.5 * weight * (r * r - 1);
            curvatures[b] = .25 * weight * (r + 1) * (r + 1) / p[b];
            if (r > problem.allowed) {
                const double excess = std::log(r / problem.allowed), steep = std::min(excess, steepest);
                sum += .5 * share * weight * steep * (2 * excess - steep);
                slopes[b] -= share * weight * steep / p[b];
                curvatures[b] += share * weight * steep / (excess * p[b] * p[b]);
            }
        }
        return sum;
    }

    // Adds what theta `a` gives to gradient and hessian, whose lower triangle is filled.
    void spread(std::size_t a, const double *by_single, const double *by_pair, double *gradient, double *hessian) {
        for (std::size_t m = 0; m < kinds; by_pair += ++m)
            for (std::size_t n = 0; n <= m; ++n) second[m * kinds + n] = second[n * kinds + m] = by_pair[n];
        for (const Parameter &d : products)
            for (std::size_t k = 0; k < lobes; ++k)
                scale[d.parameter * lobes + k] =
                    (d.parameter == cuticle::lobe_weight ? 1 : x[k]) * by_theta[(d.theta * lobes + k) * na + a];
        for (std::size_t j = 0; j < size; ++j) {
            gradient[j] += scale[j] * by_single[kind[j]];
            double *h = hessian + j * size;
            const double own = scale[j], *row = &second[kind[j] * kinds];
            for (std::size_t l = 0; l <= j; l += lobes) {  // whole parameters, past the diagonal too
                const double *other = &scale[l], *shared = row + kind[l];
                for (std::size_t k = 0; k < lobes; ++k) h[l + k] += own * other[k] * shared[k];
            }
        }
    }
};

// Out: loss (E), gradient (E, P), hessian (E, P, P). With an empty hessian only the loss is computed.
template <class Family>
void normal_equations(const Problem &problem, Out<double> loss, Out<double> gradient, Out<double> hessian) {
    const std::size_t size = problem.parameters.shape(1) * problem.parameters.shape(2);
    parallel_for(problem.q.shape(0), 1, [&](std::size_t begin, std::size_t end) {
        NormalEquations<Family> equations(problem);
        for (std::size_t e = begin; e < end; ++e)
            loss.data()[e] = hessian.size() == 0
                                 ? equations.loss(e)
                                 : equations.loss(e, gradient.data() + e * size, hessian.data() + e * size * size);
    });
}

}  // namespace

void bind_fit(nb::module_ &m) {
    m.def(
        "normal_equations",
        [](const In<double> &q, const In<double> &theta, const In<double> &theta_weight, const In<double> &phi,
           const In<double> &phi_weight, const In<double> &parameters, bool even, double allowed, double price,
           Out<double> loss, Out<double> gradient, Out<double> hessian, const std::string &family) {
            const Problem problem{q, theta, theta_weight, phi, phi_weight, parameters, even, allowed, price};
            with_family(family, [&](auto lobes) { normal_equations<decltype(lobes)>(problem, loss, gradient, hessian); });
        },
        nb::call_guard<nb::gil_scoped_release>());
}

}  // namespace native
