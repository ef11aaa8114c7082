// A mixture of K product lobes at one viewer's inclination: what a sampler evaluates and draws from.
#pragma once

#include "cuticle/lobe.h"
#include "cuticle/pack.h"

namespace cuticle {

enum LobeParameter { lobe_weight, lobe_mean_theta, lobe_sigma_theta, lobe_mean_phi, lobe_sigma_phi, lobe_parameters };

template <class Float> struct Sample {
    Float theta_i, phi, pdf;  // radians, radians, 1/sr
};

// Weights sum to 1; sigmas are positive; a mean lies in its domain or at most one sigma outside (the table is
// held to it node by node, and linear interpolation keeps it), so that CentralNormal serves.
// Azimuth: `even` takes |phi| on [0, pi] (EvenNormal), else each lobe its own period (PeriodicNormal), its mean within
// ±2 pi.
template <class Float, int K> struct Lobes {
    using Set = Pack<Float, K>;
    Set weight, scale;
    CentralNormal<Set> theta, phi;
    bool even;

    // From the lobe_parameters values of each lobe.
    CUTICLE_HD void set(const Set *parameter, bool even_) {
        weight = parameter[lobe_weight];
        even = even_;
        const Set pole(half_pi<double>), turn(pi<double>), mean = parameter[lobe_mean_phi];
        const Set lo = even ? Set(0) : Set(mean - turn), hi = even ? turn : Set(mean + turn);
        theta = central_normal(parameter[lobe_mean_theta], Set(Set(sqrt_half<double>) / parameter[lobe_sigma_theta]), -pole,
                               pole);
        phi = central_normal(mean, Set(Set(sqrt_half<double>) / parameter[lobe_sigma_phi]), lo, hi);
        // Both norms by one division.
        const double norm = two_over_sqrt_pi<double> * two_over_sqrt_pi<double> * (even ? .5 : 1.);
        scale = (weight * theta.rate) * (phi.rate * Set(norm)) / (theta.mass * phi.mass);
    }

    // 1/sr: per steradian, d omega = cos(theta_i) d theta_i d phi.
    CUTICLE_HD Float pdf(const Float &theta_i, const Float &phi_i) const {
        const Float per_steradian = Float(1) / math::cos_theta(theta_i);
        const Float wrapped = math::nearest_turn(phi_i);
        const Set zt = (Set(theta_i) - theta.mean) * theta.rate;
        Set d = Set(even ? math::abs(wrapped) : wrapped) - phi.mean;
        if (!even) {
            const Set half(pi<double>), turn(2 * pi<double>);
            d = select(d > half, Set(d - turn), select(d < -half, Set(d + turn), d));
        }
        const Set zp = d * phi.rate;
        const Float density = sum(Set(scale * decay(Set(-(zt * zt + zp * zp))))) * per_steradian;
        return select(math::abs(theta_i) > half_pi<Float>, Float(0), density);
    }

    // One lobe's cdf in theta_i (from -pi/2) and in phi (from -pi), and their inverses.
    CUTICLE_HD Float cdf_theta(int k, const Float &x) const {
        return central_cdf(lobe(theta, k), math::clamp(x, Float(-half_pi<Float>), half_pi<Float>));
    }
    CUTICLE_HD Float icdf_theta(int k, const Float &u) const { return invert_theta(lobe(theta, k), u); }
    CUTICLE_HD Float cdf_phi(int k, const Float &x) const {
        const CentralNormal<Float> d = lobe(phi, k);
        if (even) return even_cdf([&](const Float &y) { return central_cdf(d, y); }, x);
        return periodic_cdf([&](const Float &y) { return central_cdf(d, Float(d.mean + y)); }, d.mean, x);
    }
    CUTICLE_HD Float icdf_phi(int k, const Float &u) const {
        const CentralNormal<Float> d = lobe(phi, k);
        if (even) return invert_phi(d, u);
        return periodic_icdf([&](const Float &y) { return central_cdf(d, Float(d.mean + y)); },
                             [&](const Float &v) { return Float(central_icdf(d, v) - d.mean); }, d.mean, u);
    }

    // u in [0, 1): the lobe, then one inverse per coordinate; the pdf is the mixture's.
    CUTICLE_HD Sample<Float> sample(const Float &u_lobe, const Float &u_theta, const Float &u_phi) const {
        Float below[K];
        below[0] = weight[0];
        for (int k = 1; k < K; ++k) below[k] = below[k - 1] + weight[k];
        // Scaled by the sum that was reached: rounding never leads past the last lobe, nor into one of weight 0.
        const Float u = u_lobe * below[K - 1];
        int chosen = 0;
        for (int k = 0; k + 1 < K; ++k) chosen += static_cast<int>(u >= below[k]);
        const Float theta_i = invert_theta(lobe(theta, chosen), u_theta);
        const Float phi_i = invert_phi(lobe(phi, chosen), u_phi);
        return {theta_i, phi_i, pdf(theta_i, phi_i)};
    }

  private:
    CUTICLE_HD static CentralNormal<Float> lobe(const CentralNormal<Set> &d, int k) {
        return {d.mean[k], d.rate[k], d.erf_lo[k], d.mass[k]};
    }
    CUTICLE_HD static Float invert_theta(const CentralNormal<Float> &d, const Float &u) {
        // The float nearest to pi/2 lies past the pole: stay one ulp inside.
        const Float limit = half_pi<Float> * (Float(1) - std::numeric_limits<Float>::epsilon());
        return math::clamp(central_icdf(d, u), Float(-limit), limit);
    }
    // A periodic lobe is inverted from its own seam: any order of the circle serves a sample.
    CUTICLE_HD Float invert_phi(const CentralNormal<Float> &d, const Float &u) const {
        if (even) return even_icdf([&](const Float &v) { return math::clamp(central_icdf(d, v), Float(0), pi<Float>); }, u);
        return math::wrap_angle(math::clamp(central_icdf(d, u), Float(d.mean - pi<Float>), Float(d.mean + pi<Float>)));
    }
};

}  // namespace cuticle
