// Optics of a smooth dielectric cylinder: Fresnel, the modified index, the path through the fibre.
#ifndef CUTICLE_SCATTERING_OPTICS_H
#define CUTICLE_SCATTERING_OPTICS_H

#include "cuticle/math/functions.h"

namespace cuticle {

// Unpolarised Fresnel reflectance of a dielectric, light coming from outside; cos_i in [0, 1].
template <class Float> CUTICLE_INLINE Float fresnel(const Float &cos_i, const Float &eta) {
    const Float sin2_t = (Float(1) - cos_i * cos_i) / (eta * eta);
    const Float cos_t = math::sqrt(math::max(Float(Float(1) - sin2_t), Float(0)));
    const Float s = cos_i + eta * cos_t, p = eta * cos_i + cos_t;  // one division for both polarisations
    return Float(.5) * (math::sqr(Float((cos_i - eta * cos_t) * p)) + math::sqr(Float((eta * cos_i - cos_t) * s))) /
           math::sqr(Float(s * p));
}

// Bravais index eta' of the cross-section (Marschner 2003, Appendix B).
template <class Float> CUTICLE_INLINE Float bravais_index(const Float &sin_d, const Float &cos_d, const Float &eta) {
    return math::sqrt(Float(eta * eta - sin_d * sin_d)) / cos_d;
}

// One ray of the normal-plane picture: offset h = sin gamma_i at inclination theta_d.
template <class Float> struct CrossSection {
    Float gamma_i, gamma_t;  // radians
    Float fresnel;           // at cos = cos theta_d cos gamma_i
    Float chord;             // length of one internal segment in fibre radii
};

// Differs from the paper in: the chord is 2 cos gamma_t / cos theta_t; Marschner 2003 prints
// 2 (1 + cos 2 gamma_t), twice the squared chord of the unit circle (a known slip).
template <class Float> CUTICLE_INLINE Float chord_of(const Float &sin_gamma_t, const Float &sin_d, const Float &eta) {
    const Float sin_theta_t = sin_d / eta;
    const Float cos_gamma_t = math::sqrt(math::max(Float(Float(1) - sin_gamma_t * sin_gamma_t), Float(0)));
    return Float(2) / math::sqrt(Float(Float(1) - sin_theta_t * sin_theta_t)) * cos_gamma_t;
}

template <class Float>
CUTICLE_HD CrossSection<Float> cross_section(const Float &gamma_i, const Float &sin_d, const Float &cos_d,
                                             const Float &eta) {
    const Float sin_gamma_t = math::sin(gamma_i) / bravais_index(sin_d, cos_d, eta);
    return {gamma_i, math::asin(sin_gamma_t), fresnel(Float(cos_d * math::cos(gamma_i)), eta),
            chord_of(sin_gamma_t, sin_d, eta)};
}

// Attenuation A(p, h) of lobe p (0 R, 1 TT, 2 TRT) for absorption sigma_a per radius; 3 is the sum of all orders past TRT.
// With `closed` those are folded into TRT, A / (1 - F T), so that the lobes sum to 1 where nothing is absorbed;
// Marschner 2003 and d'Eon 2011 drop them, Chiang 2016 gives them a lobe of their own.
template <class Float>
CUTICLE_INLINE Float attenuation(int p, const CrossSection<Float> &ray, const Float &sigma_a, bool closed) {
    const Float f = ray.fresnel;
    if (p == 0) return f;
    const Float t = math::decay(math::min(Float(-sigma_a * ray.chord), Float(0)));  // less than none is none
    const Float tt = (Float(1) - f) * (Float(1) - f) * t;
    if (p == 1) return tt;
    const Float trt = tt * f * t;
    if (p == 2 && !closed) return trt;
    const Float all = trt / math::max(Float(Float(1) - f * t), Float(1e-9));
    return p == 2 ? all : Float(all * f * t);
}

// Azimuth phi_p(h) = 2 p gamma_t - 2 gamma_i + p pi at which lobe p leaves (unwrapped).
template <class Float> CUTICLE_INLINE Float exit_azimuth(int p, const CrossSection<Float> &ray) {
    return Float(2 * p) * ray.gamma_t - Float(2) * ray.gamma_i + Float(p) * Float(pi<double>);
}

}  // namespace cuticle

#endif  // CUTICLE_SCATTERING_OPTICS_H
