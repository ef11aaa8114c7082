// N values of a scalar type side by side, itself usable as the scalar type of the core: the lobes of a mixture are
// evaluated as one Pack, through the same lines as a single number. float and double become the compiler's vectors
// where it has them (GCC, Clang, on the host); any other type is an array and a loop.
#ifndef CUTICLE_PACK_H
#define CUTICLE_PACK_H

#include <utility>

#include "cuticle/math.h"

#if defined(__GNUC__) && !defined(__CUDACC__) && !defined(__HIPCC__)
#define CUTICLE_NATIVE_PACK 1
#pragma GCC diagnostic ignored "-Wpsabi"  // no pack crosses a function that is not inlined
#else
#define CUTICLE_NATIVE_PACK 0
#endif

#if CUTICLE_NATIVE_PACK && defined(__has_builtin)
#if __has_builtin(__builtin_shufflevector)
#define CUTICLE_NATIVE_SHUFFLE 1
#endif
#endif

namespace cuticle {
namespace detail {

// Lanes of a chunk: the largest power of two that divides N and fits 32 bytes. Wider vectors are slow where they exist
// at all; 1 is the scalar itself.
template <class T, int N> constexpr int chunk_width() {
    int width = 1;
    if (CUTICLE_NATIVE_PACK && std::is_arithmetic_v<T>)
        while (N % (2 * width) == 0 && 2 * width * int(sizeof(T)) <= 32) width *= 2;
    return width;
}

template <class T, int Width> struct Chunk {
    using type = T;
    using Mask = decltype(T(0) < T(0));
};
#if CUTICLE_NATIVE_PACK
template <int Width> struct NativeChunk {
    typedef float Single __attribute__((vector_size(4 * Width)));
    typedef double Double __attribute__((vector_size(8 * Width)));
    typedef std::int32_t Integer __attribute__((vector_size(4 * Width)));
};
#define CUTICLE_CHUNK(T, Member, Width)                   \
    template <> struct Chunk<T, Width> {                  \
        using type = typename NativeChunk<Width>::Member; \
        using Mask = decltype(type{} < type{});           \
    };
CUTICLE_CHUNK(float, Single, 2)
CUTICLE_CHUNK(float, Single, 4)
CUTICLE_CHUNK(float, Single, 8)
CUTICLE_CHUNK(double, Double, 2)
CUTICLE_CHUNK(double, Double, 4)
#undef CUTICLE_CHUNK
#endif

#if CUTICLE_NATIVE_SHUFFLE
template <class V, int... I> CUTICLE_INLINE auto join_chunks(const V &a, const V &b, std::integer_sequence<int, I...>) {
    return __builtin_shufflevector(a, b, I...);
}
template <int First, class V, int... I> CUTICLE_INLINE auto half_chunk(const V &a, std::integer_sequence<int, I...>) {
    return __builtin_shufflevector(a, a, (First + I)...);
}
#endif

}  // namespace detail

template <class T, int N> struct Pack {
    static constexpr int width = detail::chunk_width<T, N>(), chunks = N / width;
    using Chunk = typename detail::Chunk<T, width>::type;
    Chunk v[chunks];

    Pack() = default;
    CUTICLE_INLINE explicit Pack(T x) { fill(x); }  // by value: device code may not refer to a constant
    template <class S, class = std::enable_if_t<std::is_arithmetic_v<S> && !std::is_same_v<S, T>>>
    CUTICLE_INLINE explicit Pack(S x) {
        fill(T(x));
    }
    CUTICLE_INLINE void fill(const T &x) {
        for (Chunk &c : v)
            if constexpr (width > 1) c = x - Chunk{};
            else c = x;
    }
    CUTICLE_INLINE T operator[](int i) const {
        if constexpr (width > 1) return v[i / width][i % width];
        else return v[i];
    }
    CUTICLE_INLINE void set(int i, const T &x) {
        if constexpr (width > 1) v[i / width][i % width] = x;
        else v[i] = x;
    }
};

template <class T, int N> struct PackMask {
    typename detail::Chunk<T, Pack<T, N>::width>::Mask m[Pack<T, N>::chunks];
};

#define CUTICLE_PACK_BINARY(op)                                                                                 \
    template <class T, int N> CUTICLE_INLINE Pack<T, N> operator op(const Pack<T, N> &a, const Pack<T, N> &b) { \
        Pack<T, N> r;                                                                                           \
        for (int i = 0; i < Pack<T, N>::chunks; ++i) r.v[i] = a.v[i] op b.v[i];                                 \
        return r;                                                                                               \
    }
CUTICLE_PACK_BINARY(+)
CUTICLE_PACK_BINARY(-)
CUTICLE_PACK_BINARY(*)
CUTICLE_PACK_BINARY(/)
#undef CUTICLE_PACK_BINARY

#define CUTICLE_PACK_COMPARE(op)                                                                                    \
    template <class T, int N> CUTICLE_INLINE PackMask<T, N> operator op(const Pack<T, N> &a, const Pack<T, N> &b) { \
        PackMask<T, N> r;                                                                                           \
        for (int i = 0; i < Pack<T, N>::chunks; ++i) r.m[i] = a.v[i] op b.v[i];                                     \
        return r;                                                                                                   \
    }
CUTICLE_PACK_COMPARE(<)
CUTICLE_PACK_COMPARE(>)
#undef CUTICLE_PACK_COMPARE

template <class T, int N> CUTICLE_INLINE Pack<T, N> operator-(const Pack<T, N> &a) { return Pack<T, N>(T(0)) - a; }

template <class T, int N>
CUTICLE_INLINE Pack<T, N> select(const PackMask<T, N> &mask, const Pack<T, N> &a, const Pack<T, N> &b) {
    Pack<T, N> r;
    for (int i = 0; i < Pack<T, N>::chunks; ++i)
        if constexpr (Pack<T, N>::width > 1) r.v[i] = mask.m[i] ? a.v[i] : b.v[i];
        else r.v[i] = select(mask.m[i], a.v[i], b.v[i]);
    return r;
}

template <class T, int N> CUTICLE_INLINE Pack<T, N> load_pack(const T *data) {
    Pack<T, N> r;
    if constexpr (std::is_arithmetic_v<T>) std::memcpy(&r.v, data, sizeof r.v);
    else
        for (int i = 0; i < N; ++i) r.v[i] = data[i];
    return r;
}

// Two packs as one of twice the length, and its first (Part 0) or second half again.
template <class T, int N> CUTICLE_INLINE Pack<T, 2 * N> join(const Pack<T, N> &a, const Pack<T, N> &b) {
    using From = Pack<T, N>;
    Pack<T, 2 * N> r;
    if constexpr (Pack<T, 2 * N>::width == From::width) {
        for (int i = 0; i < From::chunks; ++i) {
            r.v[i] = a.v[i];
            r.v[From::chunks + i] = b.v[i];
        }
#if CUTICLE_NATIVE_SHUFFLE
    } else if constexpr (From::width > 1 && From::chunks == 1) {
        r.v[0] = detail::join_chunks(a.v[0], b.v[0], std::make_integer_sequence<int, 2 * N>());
#endif
    } else {
        for (int i = 0; i < N; ++i) {
            r.set(i, a[i]);
            r.set(N + i, b[i]);
        }
    }
    return r;
}
template <int Part, class T, int N> CUTICLE_INLINE Pack<T, N / 2> half(const Pack<T, N> &a) {
    using To = Pack<T, N / 2>;
    To r;
    if constexpr (To::width == Pack<T, N>::width) {
        for (int i = 0; i < To::chunks; ++i) r.v[i] = a.v[Part * To::chunks + i];
#if CUTICLE_NATIVE_SHUFFLE
    } else if constexpr (To::width > 1 && To::chunks == 1) {
        r.v[0] = detail::half_chunk<Part *(N / 2)>(a.v[0], std::make_integer_sequence<int, N / 2>());
#endif
    } else {
        for (int i = 0; i < N / 2; ++i) r.set(i, a[Part * (N / 2) + i]);
    }
    return r;
}

// By halves, which shortens the wait for the last addition.
template <class T, int N> CUTICLE_INLINE T sum(const Pack<T, N> &a) {
    if constexpr (N == 1) {
        return a[0];
    } else if constexpr (N % 2 == 0) {
        return sum(half<0>(a) + half<1>(a));
    } else {
        T total = a[0];
        for (int i = 1; i < N; ++i) total = total + a[i];
        return total;
    }
}

// Found from cuticle::math by argument-dependent lookup, as an array type's own functions are.
template <int N> CUTICLE_INLINE Pack<float, N> round_power(const Pack<float, N> &t, Pack<float, N> &rounded) {
    Pack<float, N> power;
    for (int i = 0; i < Pack<float, N>::chunks; ++i) {
#if CUTICLE_NATIVE_PACK
        if constexpr (Pack<float, N>::width > 1) {
            using Float = typename Pack<float, N>::Chunk;
            using Integer = typename detail::NativeChunk<Pack<float, N>::width>::Integer;
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

template <class T, int N> CUTICLE_INLINE Pack<T, N> decay(const Pack<T, N> &x) {
    if constexpr (std::is_same_v<T, float> && CUTICLE_NATIVE_PACK) return math::decay_single(x);
    Pack<T, N> r;
    for (int i = 0; i < N; ++i) r.set(i, math::decay(x[i]));
    return r;
}
template <class T, int N> CUTICLE_INLINE Pack<T, N> erf(const Pack<T, N> &x) {
    if constexpr (std::is_same_v<T, float> && CUTICLE_NATIVE_PACK) return math::erf_single(x);
    Pack<T, N> r;
    for (int i = 0; i < N; ++i) r.set(i, math::erf(x[i]));
    return r;
}

}  // namespace cuticle

#endif  // CUTICLE_PACK_H
