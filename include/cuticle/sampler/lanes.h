// How a pack of directions reads a table and arrays: what sampler.h leaves to the type, by whole loads where the compiler
// has vectors.
#ifndef CUTICLE_SAMPLER_LANES_H
#define CUTICLE_SAMPLER_LANES_H

#include <cstddef>

#include "cuticle/sampler/sampler.h"

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

namespace detail {
// The i-th of lanes' parameters, as they lie in the table.
template <class Lanes, int K> CUTICLE_INLINE Lanes &parameter(LobeValues<Lanes, K> &values, int i) {
    return i < K ? values.weight.v[i] : i < 3 * K ? values.mean.v[i - K] : values.sigma.v[i - 3 * K];
}
}  // namespace detail

#if CUTICLE_NATIVE_SHUFFLE
namespace detail {

// A quarter a lane: floats of the table, or parts of lanes.
template <int L> using Quads = typename NativeChunk<L>::Single;

// Four floats of each of the lanes 0, 4, 8, 12.
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

// The same four picked in every quarter; 4 and more are b's.
template <int P0, int P1, int P2, int P3, class V, int... I>
CUTICLE_INLINE V pick(const V &a, const V &b, std::integer_sequence<int, I...>) {
    constexpr int from[4] = {P0, P1, P2, P3}, width = sizeof...(I);
    return __builtin_shufflevector(a, b, (from[I % 4] % 4 + from[I % 4] / 4 * width + I / 4 * 4)...);
}

// Turned over: the j-th float of every lane becomes out[j]. Lanes k, k + 4, ... share a vector, so that nothing crosses its
// quarters.
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

// What interpolate_theta does for lanes by gathering, by whole loads; false where it cannot.
template <class T, int W, int B, int K>
CUTICLE_INLINE bool interpolate_lanes(const T *data, const PackIndex<W> &first, const Pack<T, W, B> &t,
                                      LobeValues<Pack<T, W, B>, K> &out) {
#if CUTICLE_NATIVE_SHUFFLE
    if constexpr (std::is_same_v<T, float> && (W == 4 || W == 8 || W == 16) && Pack<T, W, B>::chunks == 1) {
        constexpr std::make_integer_sequence<int, W> all;
        constexpr int size = lobe_parameters * K, fours = (size + 3) / 4;
        const auto start = [](int q) { return 4 * q < size - 4 ? 4 * q : size - 4; };  // the last may overlap the one before
        const auto &s = t.v[0];
        const detail::Quads<W> share[4] = {detail::pick<0, 0, 0, 0>(s, s, all), detail::pick<1, 1, 1, 1>(s, s, all),
                                           detail::pick<2, 2, 2, 2>(s, s, all), detail::pick<3, 3, 3, 3>(s, s, all)};
        detail::Quads<W> r[fours][4], turned[4];
#pragma GCC unroll 4
        for (int k = 0; k < 4; ++k)  // a lane's numbers lie side by side
#pragma GCC unroll 8
            for (int q = 0; q < fours; ++q) {
                const auto a = detail::read_quads<W>(data + start(q), first.v + k);
                r[q][k] = a + share[k] * (detail::read_quads<W>(data + size + start(q), first.v + k) - a);
            }
        for (int q = 0; q < fours; ++q) {
            detail::turn_over<W>(r[q], turned);
            for (int j = 0; j < 4; ++j) detail::parameter(out, start(q) + j).v[0] = turned[j];
        }
        return true;
    }
#endif
    static_cast<void>(data), static_cast<void>(first), static_cast<void>(t), static_cast<void>(out);
    return false;
}

namespace detail {
// A lobe in every lane, along theta and along phi.
template <bool Fine, class Lanes> CUTICLE_INLINE CentralNormal<Lanes> theta_normal(const Lanes &mean, const Lanes &sigma) {
    const Lanes pole(half_pi<double>);
    return central_normal<Fine>(mean, sigma, Lanes(-pole), pole);
}
template <bool Fine, class Lanes>
CUTICLE_INLINE CentralNormal<Lanes> phi_normal(const Lanes &mean, const Lanes &sigma, bool even) {
    const Lanes turn(pi<double>);
    return central_normal<Fine>(mean, sigma, even ? Lanes(0) : Lanes(mean - turn), even ? turn : Lanes(mean + turn));
}

}  // namespace detail

// Lanes that go side by side: as many floats as a vector holds.
template <class T> using BatchLanes = Pack<T, CUTICLE_VECTOR_BYTES / 4, detail::lane_bytes>;

namespace detail {

// The lobes' parameters at the lanes' viewers where one number of strands, which blends no two rows, serves all of them.
#if CUTICLE_NATIVE_PACK && defined(__AVX512F__)
// Values and slopes of each parameter over the nodes lie in two vectors, of which all lanes read by one permutation.
template <class T, int K> struct OneRow {
    using Lanes = BatchLanes<T>;
    using Vector = typename Lanes::Chunk;
    using Nodes = typename Chunk<std::int32_t, 16>::type;
    static constexpr int most_nodes = 32, size = lobe_parameters * K;
    Vector value[size][2], slope[size][2];

    // Making it takes as long as some fifty directions.
    static bool serves(const LobeTable<T, K> &table, std::size_t count) {
        return table.theta_nodes <= most_nodes && count >= 256;
    }
    OneRow(const LobeTable<T, K> &table, const RowPosition<T> &rows) {
        const std::ptrdiff_t row = std::ptrdiff_t(table.theta_nodes) * size;
        const T *low = table.nodes + rows.row * row, *high = table.rows > 1 ? low + row : low;
        for (int p = 0; p < size; ++p) {
            T v[most_nodes] = {}, d[most_nodes] = {};
            for (int i = 0; i < table.theta_nodes; ++i) {
                const T a = low[i * size + p], b = high[i * size + p];
                v[i] = a + rows.s * (b - a);
            }
            for (int i = 0; i + 1 < table.theta_nodes; ++i) d[i] = v[i + 1] - v[i];
            std::memcpy(value[p], v, sizeof v);
            std::memcpy(slope[p], d, sizeof d);
        }
    }
    CUTICLE_INLINE LobeValues<Lanes, K> operator()(const ThetaPosition<Lanes> &at) const {
        const Nodes node = at.node.chunk(0);
        LobeValues<Lanes, K> out;
#pragma GCC unroll 80
        for (int p = 0; p < size; ++p)
            parameter(out, p).v[0] =
                permute(value[p][0], value[p][1], node) + at.t.v[0] * permute(slope[p][0], slope[p][1], node);
        return out;
    }

  private:
    CUTICLE_INLINE static Vector permute(const Vector &a, const Vector &b, const Nodes &index) {
#if defined(__clang__)
        return __builtin_ia32_vpermi2varps512(a, index, b);
#else
        return __builtin_shuffle(a, b, index);
#endif
    }
};
#else
template <class T, int K> struct OneRow {
    using Lanes = BatchLanes<T>;
    const LobeTable<T, K> &table;
    RowPosition<T> rows;

    static bool serves(const LobeTable<T, K> &, std::size_t) { return true; }
    OneRow(const LobeTable<T, K> &table_, const RowPosition<T> &rows_) : table(table_), rows(rows_) {}
    CUTICLE_INLINE LobeValues<Lanes, K> operator()(const ThetaPosition<Lanes> &at) const {
        return values_at(table, at, rows);
    }
};
#endif

}  // namespace detail

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

#endif  // CUTICLE_SAMPLER_LANES_H
