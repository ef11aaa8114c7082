// A few numbers that are evaluated together.
#ifndef CUTICLE_SIMD_SEVERAL_H
#define CUTICLE_SIMD_SEVERAL_H

#include "cuticle/simd/pack_math.h"

namespace cuticle {

// In single precision whole vectors, padded with unused lanes; their initial values must be valid arguments, too.
template <class Float, int N> using Several = Pack<Float, !std::is_same_v<Float, float> ? N : N <= 4 ? 4 : N <= 8 ? 8 : 16>;

}  // namespace cuticle

#endif  // CUTICLE_SIMD_SEVERAL_H
