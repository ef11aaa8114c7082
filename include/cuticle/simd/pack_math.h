// Functions of packs, lane by lane. Single precision evaluates the polynomials of math/functions.h on whole vectors.
#ifndef CUTICLE_SIMD_PACK_MATH_H
#define CUTICLE_SIMD_PACK_MATH_H

#include "cuticle/math/angles.h"
#include "cuticle/math/erf.h"
#include "cuticle/simd/pack.h"

namespace cuticle {

namespace detail {

template <class V> CUTICLE_INLINE V chunk_max(const V &a, const V &b) { return a < b ? b : a; }
template <class V> CUTICLE_INLINE V chunk_min(const V &a, const V &b) { return b < a ? b : a; }
// GCC compiles the expressions above to a comparison and a blend; these are one instruction.
#if CUTICLE_NATIVE_PACK && !defined(__clang__) && defined(__SSE2__)
CUTICLE_INLINE auto chunk_max(const NativeChunk<4>::Single &a, const NativeChunk<4>::Single &b) {
    return __builtin_ia32_maxps(b, a);
}
CUTICLE_INLINE auto chunk_min(const NativeChunk<4>::Single &a, const NativeChunk<4>::Single &b) {
    return __builtin_ia32_minps(b, a);
}
#if defined(__AVX__)
CUTICLE_INLINE auto chunk_max(const NativeChunk<8>::Single &a, const NativeChunk<8>::Single &b) {
    return __builtin_ia32_maxps256(b, a);
}
CUTICLE_INLINE auto chunk_min(const NativeChunk<8>::Single &a, const NativeChunk<8>::Single &b) {
    return __builtin_ia32_minps256(b, a);
}
#endif
#if defined(__AVX512F__)
CUTICLE_INLINE auto chunk_max(const NativeChunk<16>::Single &a, const NativeChunk<16>::Single &b) {
    return __builtin_ia32_maxps512_mask(b, a, a, -1, 4);
}
CUTICLE_INLINE auto chunk_min(const NativeChunk<16>::Single &a, const NativeChunk<16>::Single &b) {
    return __builtin_ia32_minps512_mask(b, a, a, -1, 4);
}
#endif
#endif

template <class V> CUTICLE_INLINE V chunk_sqrt(const V &x) {
    V r;
    for (std::size_t i = 0; i < sizeof(V) / sizeof(x[0]); ++i) r[i] = math::sqrt(x[i]);
    return r;
}
#if CUTICLE_NATIVE_PACK && !defined(__clang__) && defined(__SSE2__)
CUTICLE_INLINE auto chunk_sqrt(const NativeChunk<4>::Single &x) { return __builtin_ia32_sqrtps(x); }
#if defined(__AVX__)
CUTICLE_INLINE auto chunk_sqrt(const NativeChunk<8>::Single &x) { return __builtin_ia32_sqrtps256(x); }
#endif
#if defined(__AVX512F__)
CUTICLE_INLINE auto chunk_sqrt(const NativeChunk<16>::Single &x) { return __builtin_ia32_sqrtps512_mask(x, x, -1, 4); }
#endif
#endif

}  // namespace detail

// cuticle::math finds these by argument-dependent lookup, as it finds any array type's functions.
template <class T, int N, int B> CUTICLE_INLINE Pack<T, N, B> max(const Pack<T, N, B> &a, const Pack<T, N, B> &b) {
    Pack<T, N, B> r;
    CUTICLE_UNROLL
    for (int i = 0; i < Pack<T, N, B>::chunks; ++i)
        if constexpr (Pack<T, N, B>::width > 1) r.v[i] = detail::chunk_max(a.v[i], b.v[i]);
        else r.v[i] = math::max(a.v[i], b.v[i]);
    return r;
}
template <class T, int N, int B> CUTICLE_INLINE Pack<T, N, B> min(const Pack<T, N, B> &a, const Pack<T, N, B> &b) {
    Pack<T, N, B> r;
    CUTICLE_UNROLL
    for (int i = 0; i < Pack<T, N, B>::chunks; ++i)
        if constexpr (Pack<T, N, B>::width > 1) r.v[i] = detail::chunk_min(a.v[i], b.v[i]);
        else r.v[i] = math::min(a.v[i], b.v[i]);
    return r;
}

template <int N, int B>
CUTICLE_INLINE Pack<float, N, B> round_power(const Pack<float, N, B> &t, Pack<float, N, B> &rounded) {
    Pack<float, N, B> power;
    CUTICLE_UNROLL
    for (int i = 0; i < Pack<float, N, B>::chunks; ++i) {
#if CUTICLE_NATIVE_PACK
        if constexpr (Pack<float, N, B>::width > 1) {
            using Float = typename Pack<float, N, B>::Chunk;
            using Integer = typename detail::NativeChunk<Pack<float, N, B>::width>::Integer;
            const Integer n = __builtin_convertvector(t.v[i] - .5f, Integer);
            rounded.v[i] = __builtin_convertvector(n, Float);
            const Integer bits = (n + 127) << 23;
            std::memcpy(&power.v[i], &bits, sizeof bits);
        } else
#endif
            power.v[i] = math::round_power(t.v[i], rounded.v[i]);
    }
    return power;
}

template <class T, int N, int B> CUTICLE_INLINE Pack<T, N, B> decay(const Pack<T, N, B> &x) {
    if constexpr (std::is_same_v<T, float> && CUTICLE_NATIVE_PACK) return math::decay_single(x);
    Pack<T, N, B> r;
    for (int i = 0; i < N; ++i) r.set(i, math::decay(x[i]));
    return r;
}
// Exponent and mantissa of normal x > 0, the mantissa on [√½, √2).
template <int N, int B>
CUTICLE_INLINE Pack<float, N, B> split_power(const Pack<float, N, B> &x, Pack<float, N, B> &exponent) {
    Pack<float, N, B> mantissa;
    CUTICLE_UNROLL
    for (int i = 0; i < Pack<float, N, B>::chunks; ++i) {
#if CUTICLE_NATIVE_PACK
        if constexpr (Pack<float, N, B>::width > 1) {
            using Integer = typename detail::NativeChunk<Pack<float, N, B>::width>::Integer;
            Integer bits;
            std::memcpy(&bits, &x.v[i], sizeof bits);
            const Integer n = (bits - 0x3f3504f3) >> 23, scaled = bits - (n << 23);
            exponent.v[i] = __builtin_convertvector(n, typename Pack<float, N, B>::Chunk);
            std::memcpy(&mantissa.v[i], &scaled, sizeof scaled);
        } else
#endif
            mantissa.v[i] = math::split_power(x.v[i], exponent.v[i]);
    }
    return mantissa;
}

template <class T, int N, int B> CUTICLE_INLINE Pack<T, N, B> log(const Pack<T, N, B> &x) {
    if constexpr (std::is_same_v<T, float> && CUTICLE_NATIVE_PACK) return math::log_single(x);
    Pack<T, N, B> r;
    for (int i = 0; i < N; ++i) r.set(i, math::log(x[i]));
    return r;
}

#define CUTICLE_PACK_FUNCTION(name)                                                              \
    template <class T, int N, int B> CUTICLE_INLINE Pack<T, N, B> name(const Pack<T, N, B> &x) { \
        Pack<T, N, B> r;                                                                         \
        for (int i = 0; i < N; ++i) r.set(i, math::name(x[i]));                                  \
        return r;                                                                                \
    }
CUTICLE_PACK_FUNCTION(exp)
CUTICLE_PACK_FUNCTION(erf)
CUTICLE_PACK_FUNCTION(erfc)
#undef CUTICLE_PACK_FUNCTION
template <class T, int N, int B> CUTICLE_INLINE Pack<T, N, B> atan2(const Pack<T, N, B> &y, const Pack<T, N, B> &x) {
    Pack<T, N, B> r;
    for (int i = 0; i < N; ++i) r.set(i, math::atan2(y[i], x[i]));
    return r;
}
template <class T, int N, int B> CUTICLE_INLINE Pack<T, N, B> abs(const Pack<T, N, B> &x) {
    return select(x < Pack<T, N, B>(T(0)), -x, x);
}
// |x| below 2^31.
template <class T, int N, int B> CUTICLE_INLINE Pack<T, N, B> floor(const Pack<T, N, B> &x) {
    using P = Pack<T, N, B>;
    P nearest;
    CUTICLE_UNROLL
    for (int i = 0; i < P::chunks; ++i) {
#if CUTICLE_NATIVE_PACK
        if constexpr (std::is_same_v<T, float> && P::width > 1) {
            const auto n = __builtin_convertvector(x.v[i], typename detail::NativeChunk<P::width>::Integer);
            nearest.v[i] = __builtin_convertvector(n, typename P::Chunk);
        } else
#endif
            if constexpr (P::width == 1)
            nearest.v[i] = math::floor(x.v[i]);
        else
            for (int k = 0; k < P::width; ++k) nearest.v[i][k] = math::floor(x.v[i][k]);
    }
    return nearest - select(nearest > x, P(T(1)), P(T(0)));
}
template <class T, int N, int B> CUTICLE_INLINE Pack<T, N, B> copysign(const Pack<T, N, B> &x, const Pack<T, N, B> &sign) {
    const Pack<T, N, B> size = abs(x);
    return select(sign < Pack<T, N, B>(T(0)), -size, size);
}

template <class T, int N, int B> CUTICLE_INLINE Pack<T, N, B> sqrt(const Pack<T, N, B> &x) {
    Pack<T, N, B> r;
    CUTICLE_UNROLL
    for (int i = 0; i < Pack<T, N, B>::chunks; ++i)
        if constexpr (Pack<T, N, B>::width > 1) r.v[i] = detail::chunk_sqrt(x.v[i]);
        else r.v[i] = math::sqrt(x.v[i]);
    return r;
}
template <class T, int N, int B> CUTICLE_INLINE Pack<T, N, B> asin(const Pack<T, N, B> &x) {
    if constexpr (std::is_same_v<T, float> && CUTICLE_NATIVE_PACK) return math::asin_signed(x);
    Pack<T, N, B> r;
    for (int i = 0; i < N; ++i) r.set(i, math::asin(x[i]));
    return r;
}

template <class T, int N, int B> CUTICLE_INLINE Pack<T, N, B> sin(const Pack<T, N, B> &x) {
    using P = Pack<T, N, B>;
    if constexpr (std::is_same_v<T, float> && CUTICLE_NATIVE_PACK) {
        return math::sin_turned(x);
    }
    P r;
    for (int i = 0; i < N; ++i) r.set(i, math::sin(x[i]));
    return r;
}
template <class T, int N, int B> CUTICLE_INLINE Pack<T, N, B> cos(const Pack<T, N, B> &x) {
    using P = Pack<T, N, B>;
    if constexpr (std::is_same_v<T, float> && CUTICLE_NATIVE_PACK) return math::cos_turned(x);
    P r;
    for (int i = 0; i < N; ++i) r.set(i, math::cos(x[i]));
    return r;
}

}  // namespace cuticle

#endif  // CUTICLE_SIMD_PACK_MATH_H
