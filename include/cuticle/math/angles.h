// Angle conventions. i points toward the light (sampled), r toward the viewer (given).
// theta in [-pi/2, pi/2] is measured from the normal plane, positive along +tangent; phi = phi_i - phi_r in (-pi, pi].
#ifndef CUTICLE_MATH_ANGLES_H
#define CUTICLE_MATH_ANGLES_H

#include "cuticle/math/functions.h"

namespace cuticle {

namespace math {

// asin on [0, 1], error below 4e-8 (Abramowitz and Stegun 4.4.46).
template <class T> CUTICLE_INLINE T asin_single(const T &x) {
    return T(half_pi<T>) - math::sqrt(math::max(T(T(1) - x), T(0))) *
                               polynomial(x, T(-.0012624911f), T(.0066700901f), T(-.0170881256f), T(.0308918810f),
                                          T(-.0501743046f), T(.0889789874f), T(-.2145988016f), T(1.5707963050f));
}
template <class T> CUTICLE_INLINE T asin_signed(const T &x) { return copysign(asin_single(T(abs(x))), x); }

}  // namespace math

template <class Float> CUTICLE_HD Float theta_half(const Float &theta_i, const Float &theta_r) {
    return Float(.5) * (theta_i + theta_r);
}

template <class Float> CUTICLE_HD Float theta_difference(const Float &theta_i, const Float &theta_r) {
    return Float(.5) * (theta_r - theta_i);
}

// A direction in a frame whose x axis is the fibre's tangent: sin theta = x, phi = atan2(z, y).
template <class Float> struct Direction {
    Float x, y, z;
};

template <class Float> CUTICLE_HD Direction<Float> direction_of(Float x, Float y, Float z) { return {x, y, z}; }

template <class Float> CUTICLE_HD Direction<Float> to_direction(const Float &theta, const Float &phi) {
    const Float c = math::cos_theta(theta);
    return {math::sin(theta), c * math::cos(phi), c * math::sin(phi)};
}

template <class Float> CUTICLE_HD Float theta_of(const Direction<Float> &w) {
    return math::atan2(w.x, math::sqrt(Float(w.y * w.y + w.z * w.z)));
}

template <class Float> CUTICLE_HD Float phi_of(const Direction<Float> &w) { return math::atan2(w.z, w.y); }

// Papers give a lobe's shift alpha and width beta in theta_h; in theta_i both are twice as large.
template <class Float> CUTICLE_HD Float half_angle_to_theta(const Float &x) { return Float(2) * x; }

}  // namespace cuticle

#endif  // CUTICLE_MATH_ANGLES_H
