// cdfs and their inverses on the circle [-pi, pi], for a density on the period around its mean and for one of |phi|.
#ifndef CUTICLE_SAMPLER_CIRCLE_H
#define CUTICLE_SAMPLER_CIRCLE_H

#include "cuticle/math/functions.h"

namespace cuticle {

// The cdf from -pi. `own(d)` is the probability between the density's seam, mean - pi, and mean + d.
template <class Float, class Own> CUTICLE_HD Float periodic_cdf(const Own &own, const Float &mean, const Float &phi) {
    const Float x = math::clamp(phi, Float(-pi<Float>), Float(pi<Float>));
    const Float start = math::wrap_angle(Float(Float(-pi<Float>) - mean)), d = math::wrap_angle(Float(x - mean));
    const Float turned = select(d < start, Float(1), Float(0));  // past the density's own seam
    return select(x < Float(pi<Float>), math::clamp(Float(own(d) - own(start) + turned), Float(0), Float(1)), Float(1));
}

// Its inverse, given the inverse of `own`.
template <class Float, class Own, class OwnInverse>
CUTICLE_HD Float periodic_icdf(const Own &own, const OwnInverse &inverse, const Float &mean, const Float &u) {
    const Float x = u + own(math::wrap_angle(Float(Float(-pi<Float>) - mean)));
    const Float phi = math::wrap_angle(Float(mean + inverse(Float(x - math::floor(x)))));
    return select(u > Float(0), phi, Float(-pi<Float>));
}

// The same for a density of |phi| with either sign equally likely; `half(x)` is the probability of |phi| < x.
template <class Float, class Half> CUTICLE_HD Float even_cdf(const Half &half, const Float &phi) {
    const Float x = math::clamp(phi, Float(-pi<Float>), Float(pi<Float>));
    return Float(.5) + math::copysign(Float(Float(.5) * half(Float(math::abs(x)))), x);
}
template <class Float, class HalfInverse> CUTICLE_HD Float even_icdf(const HalfInverse &inverse, const Float &u) {
    const Float v = Float(2) * u - Float(1);
    return math::copysign(inverse(Float(math::abs(v))), v);
}

// Reduces the difference between an azimuth in [-pi, pi] and a mean in [-2 pi, 2 pi] to [-pi, pi].
template <class Float> CUTICLE_INLINE Float short_way(const Float &d) {
    const Float limit = Float(pi<double>), turn = Float(2 * pi<double>);
    return select(d > limit, Float(d - turn), select(d < -limit, Float(d + turn), d));
}

}  // namespace cuticle

#endif  // CUTICLE_SAMPLER_CIRCLE_H
