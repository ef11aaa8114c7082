// Longitudinal scattering functions M: the Gaussian of Marschner 2003 and the energy-conserving one of d'Eon 2011.
#ifndef CUTICLE_SCATTERING_LONGITUDINAL_H
#define CUTICLE_SCATTERING_LONGITUDINAL_H

#include "cuticle/math/angles.h"

namespace cuticle {

enum class Longitudinal { gaussian, energy_conserving };

// Normal density, per radian.
template <class Float> CUTICLE_HD Float gaussian(const Float &x, const Float &variance) {
    return math::decay(Float(-x * x / (Float(2) * variance))) / math::sqrt(Float(Float(2 * pi<double>) * variance));
}

// exp(-x) I0(x), x >= 0: Abramowitz and Stegun 9.8.1 and 9.8.2, relative error below 5e-7.
// Hosts are off about x = 12: above, by ½ % where they expand log I0 and halve its 1/(8x) term; below, where they cut the
// series off, by 2 % after ten terms and ½ % after eleven.
template <class Float> CUTICLE_INLINE Float i0_scaled(const Float &x) {
    const Float split = Float(3.75);
    const Float lower = math::min(x, split), upper = math::max(x, split);
    const Float t = math::sqr(Float(lower * Float(1 / 3.75))), r = split / upper;
    const Float below =
        math::decay(Float(-lower)) * math::polynomial(t, Float(.0045813), Float(.0360768), Float(.2659732), Float(1.2067492),
                                                      Float(3.0899424), Float(3.5156229), Float(1));
    const Float above =
        math::polynomial(r, Float(.00392377), Float(-.01647633), Float(.02635537), Float(-.02057706), Float(.00916281),
                         Float(-.00157565), Float(.00225319), Float(.01328592), Float(.39894228)) /
        math::sqrt(upper);
    return select(x < split, below, above);
}

// d'Eon 2011, Eq. 7: a density in theta_i with ∫ M cos(theta_i) d theta_i = 1 for every theta_cone and variance v
// (in theta): M = csch(1/v)/(2v) exp(sin theta_i sin theta_cone / v) I0(cos theta_i cos theta_cone / v).
template <class Float>
CUTICLE_INLINE Float energy_conserving_m(const Float &theta_i, const Float &theta_cone, const Float &v) {
    const Float product = math::cos(theta_i) * math::cos(theta_cone), x = math::abs(product) / v;
    // All exponents joined, sin sin + |cos cos| - 1 being -2 sin² of half the difference (past a pole, where cos cos is
    // negative, -2 cos² of half the sum): nothing overflows, and single precision keeps its digits however small v is.
    const Float past = math::cos(Float(Float(.5) * (theta_i + theta_cone)));
    const Float half = math::sin(Float(Float(.5) * (theta_i - theta_cone)));
    const Float distance = select(product < Float(0), past, half);
    const Float over = Float(2) / v;
    // 1 - exp(-2/v), which rounding would take below 0 for wide lobes; the series never lies above it.
    const Float left = math::max(Float(Float(1) - math::decay(Float(-over))), Float(over - Float(.5) * over * over));
    return math::decay(Float(-over * distance * distance)) * i0_scaled(x) / (v * left);
}

// Draws theta_i from M cos(theta_i) (d'Eon, Marschner and Hanika 2013): a direction about the lobe's axis, of which
// cos = 1 + v ln(u + (1 - u) exp(-2/v)) with u in (0, 1], turned about that axis by `around` radians.
template <class Float>
CUTICLE_HD Float about_axis(const Float &axis, const Float &variance, const Float &u_theta, const Float &around) {
    const Float v = variance, u = Float(1) - u_theta;
    const Float inside = math::max(Float(u + (Float(1) - u) * math::decay(Float(Float(-2) / v))), Float(smallest<Float>));
    const Float c = math::clamp(Float(Float(1) + v * math::log(inside)), Float(-1), Float(1));
    const Float s = math::sqrt(math::max(Float(Float(1) - c * c), Float(0)));
    const Float sine = c * math::sin(axis) + s * math::cos(around) * math::cos(axis);
    return math::asin(math::clamp(sine, Float(-1), Float(1)));
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
               math::max(Float(c * c), Float(epsilon<Float>));
    }
    const Float cone = half_angle_to_theta(alpha) - theta_r;
    return energy_conserving_m(theta_i, cone, Float(Float(4) * variance)) / math::cos_theta(theta_i);
}

}  // namespace cuticle

#endif  // CUTICLE_SCATTERING_LONGITUDINAL_H
