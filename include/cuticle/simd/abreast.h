// Work of one kind, such as a fibre's cells, side by side in a vector where the work is on numbers. Lanes that are
// directions already, array types and GPUs take one after the other: `abreast` is 1 there.
#ifndef CUTICLE_SIMD_ABREAST_H
#define CUTICLE_SIMD_ABREAST_H

#include "cuticle/simd/pack_math.h"

namespace cuticle {

template <class Float> inline constexpr int abreast = std::is_arithmetic_v<Float> && !CUTICLE_DEVICE ? 8 : 1;
template <class Float> using Abreast = std::conditional_t<abreast<Float> == 1, Float, Pack<Float, 8>>;
// From and to the elements of an array that begin at an index.
template <class Float> CUTICLE_INLINE Abreast<Float> load_abreast(const Float *from, int at) {
    if constexpr (abreast<Float> == 1) return from[at];
    else return load_pack<Float, 8>(from + at);
}
template <class Float> CUTICLE_INLINE Abreast<Float> constants_abreast(const scalar_t<Float> *from, int at) {
    if constexpr (abreast<Float> == 1) return Float(from[at]);
    else return load_pack<Float, 8>(from + at);
}
template <class Float> CUTICLE_INLINE void store_abreast(const Abreast<Float> &x, Float *to, int at) {
    if constexpr (abreast<Float> == 1) to[at] = x;
    else std::memcpy(to + at, &x.v, sizeof x.v);
}
template <class Float> CUTICLE_INLINE Float sum_abreast(const Abreast<Float> &x) {
    if constexpr (abreast<Float> == 1) return x;
    else return sum(x);
}

}  // namespace cuticle

#endif  // CUTICLE_SIMD_ABREAST_H
