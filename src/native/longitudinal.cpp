// Mixtures of energy-conserving M's over rows of theta_i: what each puts into them, and steps of expectation and
// maximisation (Dempster, Laird and Rubin 1977). An M is the latitude of a von Mises-Fisher distribution of concentration k
// = 1/v about its axis, so that maximising is matching the mean values of sin theta_i and of its square.
#include "cuticle/scattering/longitudinal.h"
#include "arrays.h"
#include "bindings.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace native {
namespace {

constexpr double least_k = .05, most_k = 1e5;
constexpr double none = 1e-12;  // of the light: an M with less stays as it is
constexpr double least_share = 1e-7;
constexpr double most = 1e40;         // of energy over the mixture's
constexpr double unreached = 1e-250;  // where no M puts energy: the widest takes it

// The axis of the M of concentration k with this E[sin theta_i], as its sine, and E[sin²]. With A = coth k - 1/k,
// E[sin] = A sin(axis) and E[sin²] = A/k + (1 - 3 A/k) sin²(axis).
struct Moments {
    double sine, square;
};
Moments of_concentration(double k, double first) {
    const double a = 1 / std::tanh(k) - 1 / k, sine = std::clamp(first / a, -1., 1.);
    return {sine, a / k + (1 - 3 * a / k) * sine * sine};
}

struct M {
    double axis, variance;
};
M of(double k, double first) { return {std::asin(of_concentration(k, first).sine), 1 / k}; }

// The M with these mean values of sin theta_i and of its square.
M bisected(double first, double second) {
    double low = std::log(least_k), high = std::log(most_k);
    for (int step = 0; step < 60; ++step) {  // E[sin²] falls as the lobe narrows, for one mean
        const double middle = .5 * (low + high);
        const Moments m = of_concentration(std::exp(middle), first);
        (m.square > second || std::abs(m.sine) >= 1 ? low : high) = middle;
    }
    return of(std::exp(.5 * (low + high)), first);
}

// Two of Newton's steps toward it from a variance. Below coth k - 1/k = |E[sin]| there is no M: k is held where it is, by
// the approximation of Banerjee et al. 2005, at most 5 % above.
M nearer(double variance, double narrowest, double first, double second) {
    const double r = std::min(std::abs(first), 1 - 1e-9), step = 1e-4, end = std::log(most_k);
    const double low = std::clamp(std::log(std::max(r * (3 - r * r) / (1 - r * r), 1e-9)), std::log(least_k), end);
    double log_k = -std::log(variance);
    for (int n = 0; n < 2; ++n) {
        log_k = std::max(log_k, low);
        const double square = of_concentration(std::exp(log_k), first).square;
        const double further = of_concentration(std::exp(log_k + step), first).square;
        const double slope = std::min((further - square) / step, -1e-9);
        log_k = std::clamp(log_k - std::clamp((square - second) / slope, -1., 1.), low, end);
    }
    return of(std::min(std::exp(log_k), 1 / narrowest), first);
}

class Rows {
  public:
    explicit Rows(const In<double> &theta) : m_theta(theta.data()), m_sine(theta.size()), m_cosine(theta.size()) {
        for (std::size_t i = 0; i < count(); ++i) {
            m_sine[i] = std::sin(m_theta[i]);
            m_cosine[i] = std::cos(m_theta[i]);
        }
    }
    std::size_t count() const { return m_sine.size(); }
    double sine(std::size_t i) const { return m_sine[i]; }

    // What an M puts into each row, out of `share`.
    void put(double share, const M &m, double *out) const {
        double sum = 0;
        for (std::size_t i = 0; i < count(); ++i)
            sum += out[i] = cuticle::energy_conserving_m(m_theta[i], m.axis, m.variance) * m_cosine[i];
        for (std::size_t i = 0; i < count(); ++i) out[i] *= share / std::max(sum, 1e-300);
    }

  private:
    const double *m_theta;
    std::vector<double> m_sine, m_cosine;
};

// theta (rows), axis and variance (n); out (n, rows), each 1 in all.
void m_in_rows(const In<double> &theta, const In<double> &axis, const In<double> &variance, Out<double> out) {
    const Rows rows(theta);
    parallel_for(axis.size(), 64, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i)
            rows.put(1, {axis.data()[i], variance.data()[i]}, out.data() + i * rows.count());
    });
}

// Mean values (n) of sin theta_i and of its square; out: axis and variance (n).
void axis_and_variance(const In<double> &first, const In<double> &second, Out<double> axis, Out<double> variance) {
    parallel_for(first.size(), 16, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            const M m = bisected(first.data()[i], second.data()[i]);
            axis.data()[i] = m.axis;
            variance.data()[i] = m.variance;
        }
    });
}

// One step of mixtures (shares, axes and variances, each `lobes`) of stride `stride` nearer to an energy over the rows, out
// of 1. `order`: of Rényi's divergence, which is lowered. `each` and `light` are memory for lobes · rows and for rows.
void step(const Rows &rows, const double *energy, double order, double narrowest, std::size_t lobes, double *share,
          double *axis, double *variance, double *each, double *light) {
    const std::size_t count = rows.count();
    for (std::size_t k = 0; k < lobes; ++k) rows.put(share[k], {axis[k], variance[k]}, each + k * count);
    const std::size_t widest = static_cast<std::size_t>(std::max_element(variance, variance + lobes) - variance);
    double all = 0;
    for (std::size_t i = 0; i < count; ++i) {
        double whole = 0;
        for (std::size_t k = 0; k < lobes; ++k) whole += each[k * count + i];
        light[i] = energy[i] * std::pow(std::min(energy[i] / std::max(whole, unreached), most), order - 1);
        all += light[i];
        // What of a unit of light each M answers for.
        for (std::size_t k = 0; k < lobes; ++k)
            each[k * count + i] = whole > unreached ? each[k * count + i] / whole : k == widest;
    }
    double shares = 0;
    for (std::size_t k = 0; k < lobes; ++k) {
        double weight = 0, first = 0, second = 0;
        for (std::size_t i = 0; i < count; ++i) {
            const double w = each[k * count + i] * light[i] / all;
            weight += w;
            first += w * rows.sine(i);
            second += w * rows.sine(i) * rows.sine(i);
        }
        if (weight > none) {
            const M m = nearer(variance[k], narrowest, first / weight, second / weight);
            axis[k] = m.axis;
            variance[k] = m.variance;
        }
        share[k] = std::max(weight, least_share);
        shares += share[k];
    }
    for (std::size_t k = 0; k < lobes; ++k) share[k] /= shares;
}

// theta (rows), energy (n, rows), out of 1; mixture (3, n, lobes): shares, axes and variances, which `steps` steps change.
// No variance falls below `narrowest`.
void nearer_mixtures(const In<double> &theta, const In<double> &energy, double order, int steps, double narrowest,
                     Out<double> mixture) {
    const Rows rows(theta);
    const std::size_t n = energy.size() / rows.count(), lobes = mixture.size() / (3 * n);
    parallel_for(n, 8, [&](std::size_t begin, std::size_t end) {
        std::vector<double> each(lobes * rows.count()), light(rows.count());
        for (std::size_t i = begin; i < end; ++i) {
            double *share = mixture.data() + i * lobes, *axis = share + n * lobes, *variance = axis + n * lobes;
            for (int s = 0; s < steps; ++s)
                step(rows, energy.data() + i * rows.count(), order, narrowest, lobes, share, axis, variance, each.data(),
                     light.data());
        }
    });
}

}  // namespace

void bind_longitudinal(nb::module_ &m) {
    using release = nb::call_guard<nb::gil_scoped_release>;
    m.def("m_in_rows", &m_in_rows, release());
    m.def("axis_and_variance", &axis_and_variance, release());
    m.def("nearer_mixtures", &nearer_mixtures, release());
}

}  // namespace native
