// A sample, and densities per steradian.
#ifndef CUTICLE_SAMPLER_SAMPLE_H
#define CUTICLE_SAMPLER_SAMPLE_H

#include "cuticle/math/functions.h"

namespace cuticle {

template <class Float> struct Angles {
    Float theta_i, phi;  // radians
};
template <class Float> struct Sample {
    Float theta_i, phi, pdf;  // radians, radians, 1/sr
};

// 1/sr from a density in d theta_i d phi: d omega = cos(theta_i) d theta_i d phi.
template <class Float> CUTICLE_INLINE Float per_steradian(const Float &density, const Float &theta_i) {
    return select(math::abs(theta_i) > Float(half_pi<Float>), Float(0), Float(density / math::cos_theta(theta_i)));
}
// The same for a sample, which is always inside; 1/cos can be computed before the density is known.
template <class Float> CUTICLE_INLINE Float sample_per_steradian(const Float &density, const Float &theta_i) {
    return density * (Float(1) / math::cos_theta(theta_i));
}

}  // namespace cuticle

#endif  // CUTICLE_SAMPLER_SAMPLE_H
