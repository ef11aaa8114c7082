// What costs are told in: a calibration kernel and the cheapest sampler there is, for the package and benchmarks/bench.cpp.
#pragma once

#include "cuticle/math.h"

namespace native {

constexpr int kernel_inputs = 16;

// 16 independent expf calls, added to `sum`; input(k) varies with k and from call to call.
template <class Input> float calibration_kernel(float sum, const Input &input) {
    for (int k = 0; k < kernel_inputs; ++k) sum += std::exp(input(k));
    return sum;
}

// A direction on the uniform sphere with its pdf, summed.
inline float uniform_direction(float u_theta, float u_phi) {
    return std::asin(2 * u_theta - 1) + cuticle::pi<float> * (2 * u_phi - 1) + .0795774715f;
}

}  // namespace native
