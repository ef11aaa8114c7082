// How a pack of directions reads a table and arrays: what sampler.h leaves to the type, by whole loads where the compiler
// has vectors.
#ifndef CUTICLE_LANES_H
#define CUTICLE_LANES_H

#include <cstddef>

#include "cuticle/sampler.h"

namespace cuticle {

// Lane by lane.
#define CUTICLE_INDEX_BINARY(op)                                                                             \
    template <int N> CUTICLE_INLINE PackIndex<N> operator op(const PackIndex<N> &a, const PackIndex<N> &b) { \
        PackIndex<N> r;                                                                                      \
        for (int i = 0; i < N; ++i) r.v[i] = a.v[i] op b.v[i];                                               \
        return r;                                                                                            \
    }
CUTICLE_INDEX_BINARY(+)
CUTICLE_INDEX_BINARY(*)
#undef CUTICLE_INDEX_BINARY

template <int N> struct PackIndexMask {
    bool m[N];
};
template <int N> CUTICLE_INLINE PackIndexMask<N> operator<(const PackIndex<N> &a, const PackIndex<N> &b) {
    PackIndexMask<N> r;
    for (int i = 0; i < N; ++i) r.m[i] = a.v[i] < b.v[i];
    return r;
}
template <int N>
CUTICLE_INLINE PackIndex<N> select(const PackIndexMask<N> &mask, const PackIndex<N> &a, const PackIndex<N> &b) {
    PackIndex<N> r;
    for (int i = 0; i < N; ++i) r.v[i] = mask.m[i] ? a.v[i] : b.v[i];
    return r;
}
template <class T, int N, int B>
CUTICLE_INLINE PackIndex<N> select(const PackMask<T, N, B> &mask, const PackIndex<N> &a, const PackIndex<N> &b) {
    PackIndex<N> r;
    for (int i = 0; i < N; ++i) r.v[i] = mask.m[i / Pack<T, N, B>::width][i % Pack<T, N, B>::width] ? a.v[i] : b.v[i];
    return r;
}

#if CUTICLE_NATIVE_SHUFFLE
namespace detail {

// Four floats of each of eight nodes and of the nodes after them, interpolated, then turned over: the j-th of every lane
// becomes out[j]. Lanes k and k + 4 share a vector, so that turning over never crosses its halves.
using Eight = NativeChunk<8>::Single;
CUTICLE_INLINE void interpolate_quads(const float *data, const std::int32_t *first, int next, const Eight (&t)[4],
                                      Eight (&out)[4]) {
    using Four = NativeChunk<4>::Single;
    const auto pair = [&](int k, int from, Eight &both) {
        Four a, b;
        std::memcpy(&a, data + first[k] + from, sizeof a);
        std::memcpy(&b, data + first[k + 4] + from, sizeof b);
        both = __builtin_shufflevector(a, b, 0, 1, 2, 3, 4, 5, 6, 7);
    };
    Eight r[4];
    for (int k = 0; k < 4; ++k) {
        Eight a, b;
        pair(k, 0, a);
        pair(k, next, b);
        r[k] = a + t[k] * (b - a);
    }
    const Eight low01 = __builtin_shufflevector(r[0], r[1], 0, 8, 1, 9, 4, 12, 5, 13);
    const Eight high01 = __builtin_shufflevector(r[0], r[1], 2, 10, 3, 11, 6, 14, 7, 15);
    const Eight low23 = __builtin_shufflevector(r[2], r[3], 0, 8, 1, 9, 4, 12, 5, 13);
    const Eight high23 = __builtin_shufflevector(r[2], r[3], 2, 10, 3, 11, 6, 14, 7, 15);
    out[0] = __builtin_shufflevector(low01, low23, 0, 1, 8, 9, 4, 5, 12, 13);
    out[1] = __builtin_shufflevector(low01, low23, 2, 3, 10, 11, 6, 7, 14, 15);
    out[2] = __builtin_shufflevector(high01, high23, 0, 1, 8, 9, 4, 5, 12, 13);
    out[3] = __builtin_shufflevector(high01, high23, 2, 3, 10, 11, 6, 7, 14, 15);
}

// Eights as lanes and back.
template <class Lanes, int Count> CUTICLE_INLINE Lanes from_eights(const Eight (&x)[Count][4], int j) {
    Lanes r;
    if constexpr (Lanes::width == 16)
        for (int c = 0; c < Lanes::chunks; ++c)
            r.v[c] =
                __builtin_shufflevector(x[2 * c][j], x[2 * c + 1][j], 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    else
        for (int c = 0; c < Lanes::chunks; ++c) r.v[c] = x[c][j];
    return r;
}
template <class Lanes> CUTICLE_INLINE void to_eight(const Lanes &x, int c, Eight &r) {
    if constexpr (Lanes::width == 16) {
        const auto &v = x.v[c / 2];
        if (c % 2 == 0) r = __builtin_shufflevector(v, v, 0, 1, 2, 3, 4, 5, 6, 7);
        else r = __builtin_shufflevector(v, v, 8, 9, 10, 11, 12, 13, 14, 15);
    } else {
        r = x.v[c];
    }
}

}  // namespace detail
#endif

// What interpolate_theta does for lanes by gathering, by whole loads; false where it cannot.
template <class T, int W, int B, int K>
CUTICLE_INLINE bool interpolate_lanes(const T *data, const PackIndex<W> &first, const Pack<T, W, B> &t,
                                      LobeValues<Pack<T, W, B>, K> &out) {
#if CUTICLE_NATIVE_SHUFFLE
    using Lanes = Pack<T, W, B>;
    if constexpr (std::is_same_v<T, float> && (Lanes::width == 8 || Lanes::width == 16) && K % 4 == 0) {
        constexpr int eights = W / 8;
        detail::Eight pairs[eights][4], quads[eights][4];
        for (int c = 0; c < eights; ++c) {
            detail::Eight s;
            detail::to_eight(t, c, s);
            pairs[c][0] = __builtin_shufflevector(s, s, 0, 0, 0, 0, 4, 4, 4, 4);
            pairs[c][1] = __builtin_shufflevector(s, s, 1, 1, 1, 1, 5, 5, 5, 5);
            pairs[c][2] = __builtin_shufflevector(s, s, 2, 2, 2, 2, 6, 6, 6, 6);
            pairs[c][3] = __builtin_shufflevector(s, s, 3, 3, 3, 3, 7, 7, 7, 7);
        }
        for (int k = 0; k < lobe_parameters * K; k += 4) {
            for (int c = 0; c < eights; ++c)
                detail::interpolate_quads(data + k, first.v + 8 * c, lobe_parameters * K, pairs[c], quads[c]);
            auto *to = k < K ? out.weight.v + k : k < 3 * K ? out.mean.v + (k - K) : out.sigma.v + (k - 3 * K);
            for (int j = 0; j < 4; ++j) to[j] = detail::from_eights<Lanes>(quads, j);
        }
        return true;
    }
#endif
    static_cast<void>(data), static_cast<void>(first), static_cast<void>(t), static_cast<void>(out);
    return false;
}

// Lanes that go side by side: eight floats, or the sixteen of a vector of AVX-512.
#if defined(__AVX512F__)
template <class T> using BatchLanes = Pack<T, 16, 64>;
#else
template <class T> using BatchLanes = Pack<T, 8>;
#endif

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

// body(first, how many) for groups that fill the lanes, the last one in part.
template <class Lanes, class Body> CUTICLE_INLINE void groups(std::size_t count, const Body &body) {
    constexpr std::size_t width = Lanes::width * Lanes::chunks;
    for (std::size_t i = 0; i < count; i += width) body(i, static_cast<int>(count - i < width ? count - i : width));
}

}  // namespace detail
}  // namespace cuticle

#endif  // CUTICLE_LANES_H
