// A few numbers of a kind that are worked on at once.
#ifndef CUTICLE_SIMD_SEVERAL_H
#define CUTICLE_SIMD_SEVERAL_H

#include "cuticle/simd/pack_math.h"

namespace cuticle {

// In single precision one vector, filled up with lanes that nobody reads: what all lanes begin with must be in range.
template <class Float, int N> using Several = Pack<Float, !std::is_same_v<Float, float> ? N : N <= 4 ? 4 : 8>;

}  // namespace cuticle

#endif  // CUTICLE_SIMD_SEVERAL_H
