// The logistic distribution truncated to ±pi: azimuthal roughness in Chiang et al. 2016.
#ifndef CUTICLE_MATH_LOGISTIC_H
#define CUTICLE_MATH_LOGISTIC_H

#include "cuticle/math/functions.h"

namespace cuticle {

// cdf of the logistic distribution of scale s before truncation; x <= 0, so that the exponent is a decay.
template <class Float> CUTICLE_INLINE Float logistic_lower(const Float &x, const Float &s) {
    const Float e = math::decay(Float(x / s));
    return e / (Float(1) + e);
}

// Density at x in [-pi, pi], per radian.
template <class Float> CUTICLE_HD Float trimmed_logistic(const Float &x, const Float &s) {
    const Float e = math::decay(Float(-math::abs(x) / s));
    const Float kept = Float(1) - Float(2) * logistic_lower(Float(-pi<Float>), s);
    return e / (s * math::sqr(Float(Float(1) + e)) * kept);
}

// Inverse of its cdf, from u in [0, 1] to [-pi, pi]. The upper half mirrors the lower, so that neither end loses precision.
template <class Float> CUTICLE_HD Float trimmed_logistic_inverse(const Float &u, const Float &s) {
    const Float cut = logistic_lower(Float(-pi<Float>), s);
    const Float side = math::min(u, Float(Float(1) - u));
    const Float lower = math::max(Float(side * (Float(1) - Float(2) * cut) + cut), Float(smallest<Float>));
    const Float x = math::max(Float(s * math::log(Float(lower / (Float(1) - lower)))), Float(-pi<Float>));
    return math::copysign(math::min(x, Float(0)), Float(u - Float(.5)));
}

}  // namespace cuticle

#endif  // CUTICLE_MATH_LOGISTIC_H
