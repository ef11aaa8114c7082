// The sampler over arrays: directions side by side in the lanes of a vector, through the same lines as a single one.
// Fast where the compiler has vectors (GCC, Clang; float); elsewhere a plain loop.
#ifndef CUTICLE_BATCH_H
#define CUTICLE_BATCH_H

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

}  // namespace detail

// Lobe by lobe, so that a lobe's numbers stay in registers.
template <class Float, int K> CUTICLE_INLINE Lobes<Float, 1> lobe_of(const LobeValues<Float, K> &values, int k, bool even) {
    Lobes<Float, 1> lobe;
    Pack<Float, 2> mean, sigma;
    for (int i = 0; i < 2; ++i) {
        mean.set(i, values.mean[i * K + k]);
        sigma.set(i, values.sigma[i * K + k]);
    }
    lobe.set(Pack<Float, 1>(values.weight[k]), mean, sigma, even);
    return lobe;
}
template <class Float, int K>
CUTICLE_INLINE Float mixture_pdf(const LobeValues<Float, K> &values, bool even, const Float &theta_i, const Float &phi) {
    const Float wrapped = math::nearest_turn(phi);
    Float total = Float(0);
    for (int k = 0; k < K; ++k) total = total + lobe_of(values, k, even).density(theta_i, wrapped);
    return Lobes<Float, 1>::per_steradian(total, theta_i);
}

// The lobe that u chooses, alone.
template <class Float, int K>
CUTICLE_INLINE LobeValues<Float, 1> chosen_lobe(const LobeValues<Float, K> &values, const Float &u_lobe) {
    LobeValues<Float, 1> chosen;
    // Scaled by the sum that is reached in this very order, as in Lobes::choose: never into a lobe of weight 0.
    Float total = values.weight[0], below = total;
    for (int k = 1; k < K; ++k) total = total + values.weight[k];
    const Float u = u_lobe * total;
    chosen.weight.set(0, values.weight[0]);
    for (int i = 0; i < 2; ++i) {
        chosen.mean.set(i, values.mean[i * K]);
        chosen.sigma.set(i, values.sigma[i * K]);
    }
    for (int k = 1; k < K; ++k) {
        const auto past = u >= below;
        for (int i = 0; i < 2; ++i) {
            chosen.mean.set(i, select(past, values.mean[i * K + k], chosen.mean[i]));
            chosen.sigma.set(i, select(past, values.sigma[i * K + k], chosen.sigma[i]));
        }
        below = below + values.weight[k];
    }
    return chosen;
}

namespace detail {

template <class Float, int K>
CUTICLE_INLINE Float lanes_pdf(const LobeTable<scalar_t<Float>, K> &table, const Float &theta_i, const Float &theta_r,
                               const Float &phi, const Float &strands) {
    const TablePosition<Float> at = locate<Float>(table, theta_r, strands);
    if (is_blended(table, at)) return prepare_blended(table, at).pdf(theta_i, phi);
    return mixture_pdf(values_at(table, at), table.even, theta_i, phi);
}

template <class Float, int K>
CUTICLE_INLINE Sample<Float> lanes_sample(const LobeTable<scalar_t<Float>, K> &table, const Float &theta_r,
                                          const Float &u_lobe, const Float &u_theta, const Float &u_phi,
                                          const Float &strands) {
    const TablePosition<Float> at = locate<Float>(table, theta_r, strands);
    if (is_blended(table, at)) return prepare_blended(table, at).sample(u_lobe, u_theta, u_phi);
    const LobeValues<Float, K> values = values_at(table, at);
    const Lobes<Float, 1> lobe = lobe_of(chosen_lobe(values, u_lobe), 0, table.even);
    Sample<Float> s = lobe.draw({lobe.theta(0), lobe.phi(0)}, u_theta, u_phi);
    s.pdf = mixture_pdf(values, table.even, s.theta_i, s.phi);
    return s;
}

}  // namespace detail

namespace detail {

// body(first, how many) for groups that fill the lanes, the last one in part.
template <class Lanes, class Body> CUTICLE_INLINE void groups(std::size_t count, const Body &body) {
    constexpr std::size_t width = Lanes::width * Lanes::chunks;
    for (std::size_t i = 0; i < count; i += width) body(i, static_cast<int>(count - i < width ? count - i : width));
}

}  // namespace detail

// pdf of `count` directions in 1/sr. Structure of arrays; `strands` is one number for all or, with `each`, an array.
template <class T, int K>
void pdf_batch(const LobeTable<T, K> &table, std::size_t count, const T *theta_i, const T *theta_r, const T *phi,
               const T *strands, bool each, T *out) {
    if constexpr (CUTICLE_NATIVE_PACK && std::is_same_v<T, float>) {
        using Lanes = BatchLanes<T>;
        detail::groups<Lanes>(count, [&](std::size_t i, int n) {
            const auto get = [&](const T *from) { return detail::read<Lanes>(from + i, n); };
            const Lanes s = each ? get(strands) : Lanes(strands[0]);
            detail::write(detail::lanes_pdf(table, get(theta_i), get(theta_r), get(phi), s), out + i, n);
        });
    } else {
        for (std::size_t i = 0; i < count; ++i)
            out[i] = pdf(table, theta_i[i], theta_r[i], phi[i], each ? strands[i] : strands[0]);
    }
}

// `count` samples with their pdf.
template <class T, int K>
void sample_batch(const LobeTable<T, K> &table, std::size_t count, const T *theta_r, const T *u_lobe, const T *u_theta,
                  const T *u_phi, const T *strands, bool each, T *theta_i, T *phi, T *density) {
    if constexpr (CUTICLE_NATIVE_PACK && std::is_same_v<T, float>) {
        using Lanes = BatchLanes<T>;
        detail::groups<Lanes>(count, [&](std::size_t i, int n) {
            const auto get = [&](const T *from) { return detail::read<Lanes>(from + i, n); };
            const Lanes counts = each ? get(strands) : Lanes(strands[0]);
            const Sample<Lanes> s = detail::lanes_sample(table, get(theta_r), get(u_lobe), get(u_theta), get(u_phi), counts);
            detail::write(s.theta_i, theta_i + i, n);
            detail::write(s.phi, phi + i, n);
            detail::write(s.pdf, density + i, n);
        });
    } else {
        for (std::size_t i = 0; i < count; ++i) {
            const Sample<T> s = sample(table, theta_r[i], u_lobe[i], u_theta[i], u_phi[i], each ? strands[i] : strands[0]);
            theta_i[i] = s.theta_i, phi[i] = s.phi, density[i] = s.pdf;
        }
    }
}

}  // namespace cuticle

#endif  // CUTICLE_BATCH_H
