// A fibre's parameters as they enter the far field, from Chiang's roughness and from Marschner's shifts and widths.
#ifndef CUTICLE_SCATTERING_FAR_FIBRE_H
#define CUTICLE_SCATTERING_FAR_FIBRE_H

#include "cuticle/math/angles.h"
#include "cuticle/scattering/chiang.h"

namespace cuticle {

inline constexpr int far_lobes = chiang_lobes;  // the last is Chiang's rest

// Parameters as they enter f. `width` is D's: a normal's deviation or a logistic's scale, radians.
template <class Float> struct FarFibre {
    Float eta, width;
    Float tilt[far_lobes], variance[far_lobes];  // of M in theta: how far scales move a lobe, and its variance, radians
};

// Chiang 2016: longitudinal and azimuthal roughness without unit, 0.05 to 1; alpha in radians, positive toward the root.
template <class Float>
CUTICLE_HD Float longitudinal_deviation(const Float &beta_m) {  // of R's M in theta; TT has half, TRT twice
    const Float square = beta_m * beta_m, fourth = square * square, sixteenth = math::sqr(math::sqr(fourth));
    return Float(.726) * beta_m + Float(.812) * square + Float(3.7) * (sixteenth * fourth);
}
template <class Float> CUTICLE_HD Float azimuthal_scale(const Float &beta_n) {
    const Float square = beta_n * beta_n, fourth = square * square, sixteenth = math::sqr(math::sqr(fourth));
    return Float(.62665706865775006) *
           (Float(.265) * beta_n + Float(1.194) * square + Float(5.372) * (sixteenth * fourth * square));
}
// By which the root of a colour's absorption divides -ln of the colour that many such fibres show.
template <class Float> CUTICLE_HD Float color_divisor(const Float &beta_n) {
    return math::polynomial(beta_n, Float(.245), Float(5.574), Float(-10.73), Float(2.532), Float(-.215), Float(5.969));
}
template <class Float>
CUTICLE_HD FarFibre<Float> chiang_fibre(const Float &beta_m, const Float &beta_n, const Float &alpha, const Float &eta) {
    const Float v = math::sqr(longitudinal_deviation(beta_m));
    FarFibre<Float> fibre;
    fibre.eta = eta;
    fibre.width = azimuthal_scale(beta_n);
    fibre.tilt[0] = Float(-2) * alpha;
    fibre.tilt[1] = alpha;
    fibre.tilt[2] = Float(4) * alpha;
    fibre.tilt[3] = Float(0);
    fibre.variance[0] = v;
    fibre.variance[1] = Float(.25) * v;
    fibre.variance[2] = Float(4) * v;
    fibre.variance[3] = Float(4) * v;
    return fibre;
}

// Marschner 2003's shifts and deviations of R, TT and TRT in theta_h, with d'Eon's M; beta_n: of the normal D. Radians.
template <class Float>
CUTICLE_HD FarFibre<Float> marschner_fibre(const Float &alpha_r, const Float &alpha_tt, const Float &alpha_trt,
                                           const Float &beta_r, const Float &beta_tt, const Float &beta_trt,
                                           const Float &beta_n, const Float &eta) {
    FarFibre<Float> fibre;
    fibre.eta = eta;
    fibre.width = beta_n;
    fibre.tilt[0] = half_angle_to_theta(alpha_r);
    fibre.tilt[1] = half_angle_to_theta(alpha_tt);
    fibre.tilt[2] = half_angle_to_theta(alpha_trt);
    fibre.tilt[3] = Float(0);
    fibre.variance[0] = math::sqr(half_angle_to_theta(beta_r));
    fibre.variance[1] = math::sqr(half_angle_to_theta(beta_tt));
    fibre.variance[2] = math::sqr(half_angle_to_theta(beta_trt));
    fibre.variance[3] = Float(1);  // the orders past TRT are in TRT
    return fibre;
}

}  // namespace cuticle

#endif  // CUTICLE_SCATTERING_FAR_FIBRE_H
