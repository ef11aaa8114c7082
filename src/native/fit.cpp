// The fit's inner loop: 1/ESS of a mixture at many viewer angles, with the gradient and the Gauss-Newton matrix in the
// lobes' own parameters.
//
// With q and p densities in d theta d phi, 1/ESS - 1 = ∫ q²/p - 1 = ∫ (q - p)²/p: a sum of squares of
// r = (q - p)/√p, so minimising 1/ESS itself is a least-squares problem.
#include "arrays.h"
#include "bindings.h"

#include "cuticle/lobe.h"
#include "cuticle/lobes.h"

#include <vector>

namespace native {
namespace {

// One lobe's density along one coordinate at `count` points, and its derivatives by mean and sigma.
void normal_with_derivatives(double mean, double sigma, double lo, double hi, const double *x, std::size_t count,
                             double *value, double *by_mean, double *by_sigma) {
    const auto d = cuticle::central_normal(mean, cuticle::sqrt_half<double> / sigma, lo, hi);
    const double norm = cuticle::central_norm(d);
    const double za = (lo - mean) / sigma, zb = (hi - mean) / sigma;
    const double fa = norm * std::exp(-.5 * za * za), fb = norm * std::exp(-.5 * zb * zb);  // density at the ends
    for (std::size_t i = 0; i < count; ++i) {
        const double z = (x[i] - mean) / sigma;
        value[i] = norm * std::exp(-.5 * z * z);
        by_mean[i] = value[i] * (z / sigma + fb - fa);
        by_sigma[i] = value[i] * ((z * z - 1) / sigma + zb * fb - za * fa);
    }
}

// For each of E viewer angles: q (E, A, B), its grid theta (E, A) and phi (E, B) with quadrature weights, parameters
// (E, lobe_parameters, K). Out: loss (E) = ½ ∫ (q - p)²/p, gradient (E, P), hessian (E, P, P), P = lobe_parameters K.
// With an empty hessian only the loss is computed.
void normal_equations(const In<double> &q, const In<double> &theta, const In<double> &theta_weight, const In<double> &phi,
                      const In<double> &phi_weight, const In<double> &parameters, bool even, Out<double> loss,
                      Out<double> gradient, Out<double> hessian) {
    const std::size_t evaluations = q.shape(0), na = q.shape(1), nb_ = q.shape(2), lobes = parameters.shape(2);
    const std::size_t size = cuticle::lobe_parameters * lobes;
    const bool derivatives = hessian.size() > 0;
    const double least = 1e-30;  // keeps q²/p finite where every lobe has died out
    parallel_for(evaluations, 1, [&](std::size_t begin, std::size_t end) {
        std::vector<double> t(3 * lobes * na), f(3 * lobes * nb_), g(size), column(size), row(lobes);
        std::vector<double> wrapped(nb_);
        for (std::size_t e = begin; e < end; ++e) {
            const double *x = parameters.data() + e * size;
            const double *phis = phi.data() + e * nb_;
            for (std::size_t k = 0; k < lobes; ++k) {
                normal_with_derivatives(x[cuticle::lobe_mean_theta * lobes + k], x[cuticle::lobe_sigma_theta * lobes + k],
                                        -cuticle::half_pi<double>, cuticle::half_pi<double>, theta.data() + e * na, na,
                                        &t[3 * k * na], &t[(3 * k + 1) * na], &t[(3 * k + 2) * na]);
                const double mean = x[cuticle::lobe_mean_phi * lobes + k], pi = cuticle::pi<double>;
                for (std::size_t b = 0; b < nb_; ++b)
                    wrapped[b] = even ? phis[b] : mean + cuticle::math::wrap_angle(phis[b] - mean);
                normal_with_derivatives(mean, x[cuticle::lobe_sigma_phi * lobes + k], even ? 0 : mean - pi,
                                        even ? pi : mean + pi, wrapped.data(), nb_, &f[3 * k * nb_], &f[(3 * k + 1) * nb_],
                                        &f[(3 * k + 2) * nb_]);
                if (!even)  // the period moves with the mean: its ends add nothing
                    for (std::size_t b = 0; b < nb_; ++b)
                        f[(3 * k + 1) * nb_ + b] = f[3 * k * nb_ + b] * (wrapped[b] - mean) /
                                                   cuticle::math::sqr(x[cuticle::lobe_sigma_phi * lobes + k]);
            }
            double total = 0;
            double *out_g = derivatives ? gradient.data() + e * size : nullptr;
            double *out_h = derivatives ? hessian.data() + e * size * size : nullptr;
            if (derivatives) {
                std::fill(out_g, out_g + size, 0.);
                std::fill(out_h, out_h + size * size, 0.);
            }
            for (std::size_t a = 0; a < na; ++a)
                for (std::size_t b = 0; b < nb_; ++b) {
                    const double weight = theta_weight.data()[e * na + a] * phi_weight.data()[e * nb_ + b];
                    double p = least;
                    for (std::size_t k = 0; k < lobes; ++k) p += x[k] * t[3 * k * na + a] * f[3 * k * nb_ + b];
                    const double target = q.data()[(e * na + a) * nb_ + b];
                    total += .5 * weight * (target - p) * (target - p) / p;
                    if (!derivatives) continue;
                    for (std::size_t k = 0; k < lobes; ++k) {
                        const double tv = t[3 * k * na + a], fv = f[3 * k * nb_ + b], w = x[k];
                        g[k] = tv * fv;
                        g[cuticle::lobe_mean_theta * lobes + k] = w * t[(3 * k + 1) * na + a] * fv;
                        g[cuticle::lobe_sigma_theta * lobes + k] = w * t[(3 * k + 2) * na + a] * fv;
                        g[cuticle::lobe_mean_phi * lobes + k] = w * tv * f[(3 * k + 1) * nb_ + b];
                        g[cuticle::lobe_sigma_phi * lobes + k] = w * tv * f[(3 * k + 2) * nb_ + b];
                    }
                    const double slope = -.5 * weight * (target * target - p * p) / (p * p);
                    const double curvature = .25 * weight * (target + p) * (target + p) / (p * p * p);
                    for (std::size_t j = 0; j < size; ++j) {
                        out_g[j] += slope * g[j];
                        const double c = curvature * g[j];
                        double *h = out_h + j * size;
                        for (std::size_t l = 0; l <= j; ++l) h[l] += c * g[l];
                    }
                }
            loss.data()[e] = total;
            if (derivatives)
                for (std::size_t j = 0; j < size; ++j)
                    for (std::size_t l = j + 1; l < size; ++l) out_h[j * size + l] = out_h[l * size + j];
        }
    });
}

}  // namespace

void bind_fit(nb::module_ &m) { m.def("normal_equations", &normal_equations, nb::call_guard<nb::gil_scoped_release>()); }

}  // namespace native
