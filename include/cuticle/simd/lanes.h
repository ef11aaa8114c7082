// Packs whose lanes are directions: indices into memory, whole vector loads from a table where the compiler has vectors,
// and arrays read and written in groups of lanes.
#ifndef CUTICLE_SIMD_LANES_H
#define CUTICLE_SIMD_LANES_H

#include "cuticle/simd/pack_math.h"

namespace cuticle {

#define CUTICLE_INDEX_BINARY(op)                                                                             \
    template <int N> CUTICLE_INLINE PackIndex<N> operator op(const PackIndex<N> &a, const PackIndex<N> &b) { \
        PackIndex<N> r;                                                                                      \
        for (int i = 0; i < N; i += r.width) r.put(i, a.chunk(i) op b.chunk(i));                             \
        return r;                                                                                            \
    }
CUTICLE_INDEX_BINARY(+)
CUTICLE_INDEX_BINARY(*)
#undef CUTICLE_INDEX_BINARY

template <class T, int N, int B>
CUTICLE_INLINE PackIndex<N> select(const PackMask<T, N, B> &mask, const PackIndex<N> &a, const PackIndex<N> &b) {
    constexpr int width = Pack<T, N, B>::width;
    PackIndex<N> r;
    if constexpr (width > 1 && width == PackIndex<N>::width && sizeof(T) == sizeof(std::int32_t))
        for (int i = 0; i < N; i += width) r.put(i, mask.m[i / width] ? a.chunk(i) : b.chunk(i));
    else if constexpr (width > 1)
        for (int i = 0; i < N; ++i) r.v[i] = mask.m[i / width][i % width] ? a.v[i] : b.v[i];
    else
        for (int i = 0; i < N; ++i) r.v[i] = mask.m[i] ? a.v[i] : b.v[i];
    return r;
}

#define CUTICLE_INDEX_CHOICE(name, op)                                                                \
    template <int N> CUTICLE_INLINE PackIndex<N> name(const PackIndex<N> &a, const PackIndex<N> &b) { \
        PackIndex<N> r;                                                                               \
        for (int i = 0; i < N; ++i) r.v[i] = b.v[i] op a.v[i] ? b.v[i] : a.v[i];                      \
        return r;                                                                                     \
    }
CUTICLE_INDEX_CHOICE(min, <)
CUTICLE_INDEX_CHOICE(max, >)
#undef CUTICLE_INDEX_CHOICE

#if CUTICLE_NATIVE_SHUFFLE
namespace detail {

// L floats in groups of four: four table entries of one lane or, transposed, one entry of four lanes.
template <int L> using Quads = typename NativeChunk<L>::Single;

// Reads four consecutive floats for each of the lanes 0, 4, 8, 12, one group a lane.
template <int L> CUTICLE_INLINE Quads<L> read_quads(const float *data, const std::int32_t *first) {
    if constexpr (L == 4) {
        Quads<4> r;
        std::memcpy(&r, data + *first, sizeof r);
        return r;
    } else {
        const Quads<L / 2> a = read_quads<L / 2>(data, first), b = read_quads<L / 2>(data, first + L / 2);
#if defined(__AVX__) && !defined(__clang__)  // GCC makes a shuffle of what is one load
        if constexpr (L == 8)
            return __builtin_ia32_vinsertf128_ps256(__builtin_shufflevector(a, a, 0, 1, 2, 3, -1, -1, -1, -1), b, 1);
#endif
        return join_chunks(a, b, std::make_integer_sequence<int, L>());
    }
}

// Applies one shuffle to each group of four; indices from 4 on select from b.
template <int P0, int P1, int P2, int P3, class V, int... At>
CUTICLE_INLINE V pick(const V &a, const V &b, std::integer_sequence<int, At...>) {
    constexpr int from[4] = {P0, P1, P2, P3}, width = sizeof...(At);
    return __builtin_shufflevector(a, b, (from[At % 4] % 4 + from[At % 4] / 4 * width + At / 4 * 4)...);
}

// Transposes: out[j] holds the j-th float of every lane. Lanes k, k + 4, ... share a vector, so that no shuffle crosses
// groups of four.
template <int L> CUTICLE_INLINE void turn_over(const Quads<L> (&r)[4], Quads<L> (&out)[4]) {
    constexpr std::make_integer_sequence<int, L> all;
    const auto low01 = pick<0, 4, 1, 5>(r[0], r[1], all), high01 = pick<2, 6, 3, 7>(r[0], r[1], all);
    const auto low23 = pick<0, 4, 1, 5>(r[2], r[3], all), high23 = pick<2, 6, 3, 7>(r[2], r[3], all);
    out[0] = pick<0, 1, 4, 5>(low01, low23, all);
    out[1] = pick<2, 3, 6, 7>(low01, low23, all);
    out[2] = pick<0, 1, 4, 5>(high01, high23, all);
    out[3] = pick<2, 3, 6, 7>(high01, high23, all);
}

}  // namespace detail
#endif

// The pack for directions in batches: as many floats as a vector holds.
template <class T> using BatchLanes = Pack<T, CUTICLE_VECTOR_BYTES / 4, detail::lane_bytes>;

namespace detail {

template <class Lanes, class T> CUTICLE_INLINE Lanes read(const T *from, int count) {
    Lanes r(from[0]);
    if (count == Lanes::width * Lanes::chunks) std::memcpy(&r.v, from, sizeof r.v);
    else
        for (int i = 1; i < count; ++i) r.set(i, from[i]);
    return r;
}
template <class Lanes, class T> CUTICLE_INLINE void write(const Lanes &x, T *to, int count) {
    if (count == Lanes::width * Lanes::chunks) std::memcpy(to, &x.v, sizeof x.v);
    else
        for (int i = 0; i < count; ++i) to[i] = x[i];
}

// Calls body(first, count) for groups that fill the lanes; the last may fill them in part.
template <class Lanes, class Body> CUTICLE_INLINE void groups(std::size_t count, const Body &body) {
    constexpr std::size_t width = Lanes::width * Lanes::chunks;
    for (std::size_t i = 0; i < count; i += width) body(i, static_cast<int>(count - i < width ? count - i : width));
}

}  // namespace detail
}  // namespace cuticle

#endif  // CUTICLE_SIMD_LANES_H
