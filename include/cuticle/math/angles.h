// Angle conventions. i points toward the light (sampled), r toward the viewer (given).
// theta in [-pi/2, pi/2] is measured from the normal plane, positive along +tangent; phi = phi_i - phi_r in (-pi, pi].
#ifndef CUTICLE_MATH_ANGLES_H
#define CUTICLE_MATH_ANGLES_H

#include "cuticle/math/functions.h"

namespace cuticle {

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
