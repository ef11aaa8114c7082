// N values of a scalar type side by side, itself usable as the scalar type of the core: the lobes of a mixture are
// evaluated as one Pack, through the same lines as a single number. float and double become the compiler's vectors
// where it has them (GCC, Clang, on the host); any other type is an array and a loop.
#pragma once

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

template <class T, int N> struct PackStorage {
    struct type {
        T v[N];
        CUTICLE_HD T &operator[](int i) { return v[i]; }
        CUTICLE_HD const T &operator[](int i) const { return v[i]; }
    };
    static constexpr bool native = false;
};
#if CUTICLE_NATIVE_PACK
template <int N> struct PackStorage<float, N> {
    typedef float type __attribute__((vector_size(4 * N)));
    static constexpr bool native = true;
};
template <int N> struct PackStorage<double, N> {
    typedef double type __attribute__((vector_size(8 * N)));
    static constexpr bool native = true;
};
template <int N> struct PackStorage<std::int32_t, N> {
    typedef std::int32_t type __attribute__((vector_size(4 * N)));
    static constexpr bool native = true;
};
#endif

}  // namespace detail

template <class T, int N> struct Pack {
    using Storage = typename detail::PackStorage<T, N>::type;
    static constexpr bool native = detail::PackStorage<T, N>::native;
    Storage v;

    Pack() = default;
    CUTICLE_INLINE explicit Pack(const T &x) { fill(x); }
    template <class S, class = std::enable_if_t<std::is_arithmetic_v<S> && !std::is_same_v<S, T>>>
    CUTICLE_INLINE explicit Pack(S x) {
        fill(T(x));
    }
    CUTICLE_INLINE void fill(const T &x) {
        if constexpr (native) v = x - Storage{};
        else
            for (int i = 0; i < N; ++i) v[i] = x;
    }
    CUTICLE_INLINE T operator[](int i) const { return v[i]; }
};

template <class T, int N> struct PackMask {
#if CUTICLE_NATIVE_PACK
    using Native = decltype(typename detail::PackStorage<float, N>::type{} < typename detail::PackStorage<float, N>::type{});
    using NativeWide =
        decltype(typename detail::PackStorage<double, N>::type{} < typename detail::PackStorage<double, N>::type{});
    using Storage = std::conditional_t<std::is_same_v<T, float>, Native,
                                       std::conditional_t<std::is_same_v<T, double>, NativeWide,
                                                          typename detail::PackStorage<decltype(T(0) < T(0)), N>::type>>;
#else
    using Storage = typename detail::PackStorage<decltype(T(0) < T(0)), N>::type;
#endif
    Storage m;
};

#define CUTICLE_PACK_BINARY(op)                                                                                 \
    template <class T, int N> CUTICLE_INLINE Pack<T, N> operator op(const Pack<T, N> &a, const Pack<T, N> &b) { \
        Pack<T, N> r;                                                                                           \
        if constexpr (Pack<T, N>::native) r.v = a.v op b.v;                                                     \
        else                                                                                                    \
            for (int i = 0; i < N; ++i) r.v[i] = a.v[i] op b.v[i];                                              \
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
        if constexpr (Pack<T, N>::native) r.m = a.v op b.v;                                                         \
        else                                                                                                        \
            for (int i = 0; i < N; ++i) r.m[i] = a.v[i] op b.v[i];                                                  \
        return r;                                                                                                   \
    }
CUTICLE_PACK_COMPARE(<)
CUTICLE_PACK_COMPARE(>)
#undef CUTICLE_PACK_COMPARE

template <class T, int N> CUTICLE_INLINE Pack<T, N> operator-(const Pack<T, N> &a) { return Pack<T, N>(T(0)) - a; }

template <class T, int N>
CUTICLE_INLINE Pack<T, N> select(const PackMask<T, N> &mask, const Pack<T, N> &a, const Pack<T, N> &b) {
    Pack<T, N> r;
    if constexpr (Pack<T, N>::native) r.v = mask.m ? a.v : b.v;
    else
        for (int i = 0; i < N; ++i) r.v[i] = select(mask.m[i], a.v[i], b.v[i]);
    return r;
}

template <class T, int N> CUTICLE_INLINE Pack<T, N> load_pack(const T *data) {
    Pack<T, N> r;
    if constexpr (Pack<T, N>::native) std::memcpy(&r.v, data, sizeof r.v);
    else
        for (int i = 0; i < N; ++i) r.v[i] = data[i];
    return r;
}

// Pairwise, which halves the wait for the last addition.
template <class T, int N> CUTICLE_INLINE T sum(const Pack<T, N> &a) {
    T part[N];
    for (int i = 0; i < N; ++i) part[i] = a[i];
    for (int step = 1; step < N; step *= 2)
        for (int i = 0; i + step < N; i += 2 * step) part[i] = part[i] + part[i + step];
    return part[0];
}

// Found from cuticle::math by argument-dependent lookup, as an array type's own functions are.
#if CUTICLE_NATIVE_PACK
template <int N> CUTICLE_INLINE Pack<float, N> round_power(const Pack<float, N> &t, Pack<float, N> &rounded) {
    using Int = typename detail::PackStorage<std::int32_t, N>::type;
    const Int n = __builtin_convertvector((t - Pack<float, N>(.5f)).v, Int);
    rounded.v = __builtin_convertvector(n, typename Pack<float, N>::Storage);
    const Int bits = (n + 127) << 23;
    Pack<float, N> power;
    std::memcpy(&power.v, &bits, sizeof bits);
    return power;
}
template <int N> CUTICLE_INLINE Pack<float, N> decay(const Pack<float, N> &x) { return math::decay_single(x); }
template <int N> CUTICLE_INLINE Pack<float, N> erf(const Pack<float, N> &x) { return math::erf_single(x); }

#if CUTICLE_NATIVE_SHUFFLE
// Two small packs are evaluated as one of up to 32 bytes; wider ones cost more to split again than they save.
template <int N, int... I>
CUTICLE_INLINE void erf_pair(const Pack<float, N> &a, const Pack<float, N> &b, Pack<float, N> &erf_a, Pack<float, N> &erf_b,
                             std::integer_sequence<int, I...>) {
    Pack<float, 2 * N> both;
    both.v = __builtin_shufflevector(a.v, b.v, I..., (N + I)...);
    both = erf(both);
    erf_a.v = __builtin_shufflevector(both.v, both.v, I...);
    erf_b.v = __builtin_shufflevector(both.v, both.v, (N + I)...);
}
template <int N, class = std::enable_if_t<(N > 1 && N <= 4)>>
CUTICLE_INLINE void erf_pair(const Pack<float, N> &a, const Pack<float, N> &b, Pack<float, N> &erf_a,
                             Pack<float, N> &erf_b) {
    erf_pair(a, b, erf_a, erf_b, std::make_integer_sequence<int, N>());
}
#endif
#endif
template <class T, int N> CUTICLE_INLINE Pack<T, N> decay(const Pack<T, N> &x) {
    Pack<T, N> r;
    for (int i = 0; i < N; ++i) r.v[i] = math::decay(x[i]);
    return r;
}
template <class T, int N> CUTICLE_INLINE Pack<T, N> erf(const Pack<T, N> &x) {
    Pack<T, N> r;
    for (int i = 0; i < N; ++i) r.v[i] = math::erf(x[i]);
    return r;
}

}  // namespace cuticle
