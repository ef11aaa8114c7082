// Longitudinal scattering functions M: the Gaussian of Marschner 2003 and the energy-conserving one of d'Eon 2011.
#pragma once

#include "cuticle/angles.h"

namespace cuticle {

enum class Longitudinal { gaussian, energy_conserving };

// Normal density, per radian.
template <class Float> CUTICLE_HD Float gaussian(const Float &x, const Float &variance) {
    return math::exp(Float(-x * x / (Float(2) * variance))) / math::sqrt(Float(Float(2) * pi<Float> * variance));
}

// exp(-x) I0(x), x >= 0: the power series below 12, the asymptotic one (DLMF 10.40.1) above, both to 1e-9. Hosts that halve
// the latter's 1/(8x) term are off by 2 % at x = 12.
template <class Float> CUTICLE_HD Float i0_scaled_series(const Float &x) {
    const Float q = Float(.25) * x * x;
    Float term = Float(1), series = Float(1);
    for (int k = 1; k <= 34; ++k) {
        term = term * q * Float(1.0 / (double(k) * k));
        series = series + term;
    }
    return math::exp(Float(-x)) * series;
}

template <class Float> CUTICLE_HD Float i0_scaled_asymptotic(const Float &x) {
    const Float r = Float(1) / (Float(8) * x);
    Float term = Float(1), series = Float(1);
    for (int k = 1; k <= 14; ++k) {
        term = term * r * Float(double(2 * k - 1) * (2 * k - 1) / k);
        series = series + term;
    }
    return series / math::sqrt(Float(Float(2) * pi<Float> * x));
}

template <class Float> CUTICLE_HD Float i0_scaled(const Float &x) {
    if constexpr (std::is_arithmetic_v<Float>) return x < Float(12) ? i0_scaled_series(x) : i0_scaled_asymptotic(x);
    else
        return select(x < Float(12), i0_scaled_series(Float(math::min(x, Float(12)))),
                      i0_scaled_asymptotic(Float(math::max(x, Float(12)))));
}

// d'Eon 2011, Eq. 7: a density in theta_i with ∫ M cos(theta_i) d theta_i = 1 for every theta_cone and variance v
// (in theta): M = csch(1/v)/(2v) exp(sin theta_i sin theta_cone / v) I0(cos theta_i cos theta_cone / v).
template <class Float> CUTICLE_HD Float energy_conserving_m(const Float &theta_i, const Float &theta_cone, const Float &v) {
    const Float x = math::abs(Float(math::cos(theta_i) * math::cos(theta_cone))) / v;
    const Float s = math::sin(theta_i) * math::sin(theta_cone) / v;
    // All exponents joined: s + x - 1/v <= 0, so nothing overflows.
    const Float decay = Float(1) - math::exp(Float(Float(-2) / v));
    return math::exp(Float(s + x - Float(1) / v)) * i0_scaled(x) / (v * decay);
}

// A lobe's longitudinal part as it multiplies N in f, for shift alpha and variance (both in theta_h):
// gaussian: g(theta_h - alpha) / cos² theta_d (Marschner 2003, Eq. 1; g is a density in theta_h);
// energy_conserving: M / cos theta_i, so that ∫ f cos theta_i d omega_i = ∫ N d phi.
template <class Float>
CUTICLE_HD Float longitudinal(Longitudinal form, const Float &theta_i, const Float &theta_r, const Float &alpha,
                              const Float &variance) {
    if (form == Longitudinal::gaussian) {
        const Float c = math::cos(theta_difference(theta_i, theta_r));
        return gaussian(Float(theta_half(theta_i, theta_r) - alpha), variance) /
               math::max(Float(c * c), std::numeric_limits<Float>::epsilon());
    }
    const Float cone = half_angle_to_theta(alpha) - theta_r;
    return energy_conserving_m(theta_i, cone, Float(Float(4) * variance)) / math::cos_theta(theta_i);
}

}  // namespace cuticle
