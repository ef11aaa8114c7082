// Chunks, of which packs are made: vectors of the compiler (GCC and Clang, on the host), elsewhere single numbers.
#ifndef CUTICLE_SIMD_CHUNK_H
#define CUTICLE_SIMD_CHUNK_H

#include "cuticle/math/functions.h"

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

// The widest vectors of the target machine. Compilers split wider ones, GCC into single numbers.
#if defined(__AVX512F__)
#define CUTICLE_VECTOR_BYTES 64
#elif defined(__AVX__)
#define CUTICLE_VECTOR_BYTES 32
#else
#define CUTICLE_VECTOR_BYTES 16
#endif

namespace cuticle {
namespace detail {

// Lanes of a chunk: the largest power of two that divides N and fits in `Bytes`; 1 means the scalar itself.
template <class T, int N, int Bytes> constexpr int chunk_width() {
    int width = 1;
    if (CUTICLE_NATIVE_PACK && std::is_arithmetic_v<T>)
        while (N % (2 * width) == 0 && 2 * width * int(sizeof(T)) <= Bytes) width *= 2;
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
CUTICLE_CHUNK(float, Single, 16)
CUTICLE_CHUNK(double, Double, 2)
CUTICLE_CHUNK(double, Double, 4)
CUTICLE_CHUNK(double, Double, 8)
CUTICLE_CHUNK(std::int32_t, Integer, 2)
CUTICLE_CHUNK(std::int32_t, Integer, 4)
CUTICLE_CHUNK(std::int32_t, Integer, 8)
CUTICLE_CHUNK(std::int32_t, Integer, 16)
#undef CUTICLE_CHUNK

// Whether any bit is set: halves are combined until single words are left.
template <class V> CUTICLE_INLINE bool any_bit(const V &x) {
    if constexpr (sizeof(V) > 16) {
        typename NativeChunk<sizeof(V) / 8>::Integer half[2];
        std::memcpy(half, &x, sizeof x);
        return any_bit(half[0] | half[1]);
    } else {
        std::uint64_t words[(sizeof(V) + 7) / 8] = {};
        std::memcpy(words, &x, sizeof x);
        return (words[0] | words[sizeof(V) / 16]) != 0;
    }
}
#endif

#if CUTICLE_NATIVE_SHUFFLE
template <class V, int... Lanes>
CUTICLE_INLINE auto join_chunks(const V &a, const V &b, std::integer_sequence<int, Lanes...>) {
    return __builtin_shufflevector(a, b, Lanes...);
}
template <int First, class V, int... Lanes>
CUTICLE_INLINE auto half_chunk(const V &a, std::integer_sequence<int, Lanes...>) {
    return __builtin_shufflevector(a, a, (First + Lanes)...);
}
#endif

// Copies its vectors one by one. GCC copies a struct of vectors through memory in narrower stores than the following load,
// which defeats store forwarding.
template <class Vector, int Count, bool Apart> struct Chunks {
    Vector v[Count];
};
template <class Vector, int Count> struct Chunks<Vector, Count, true> {
    Vector v[Count];

    Chunks() = default;
    CUTICLE_INLINE Chunks(const Chunks &x) { *this = x; }
    CUTICLE_INLINE Chunks &operator=(const Chunks &x) {
        CUTICLE_UNROLL
        for (int i = 0; i < Count; ++i) v[i] = x.v[i];
        return *this;
    }
};

// The B of packs whose lanes are directions, not lobes. The compiler copies arrays of such packs best by itself.
inline constexpr int lane_bytes = 64;
template <class T, int N, int B>
using ChunksOf = Chunks<typename Chunk<T, chunk_width<T, N, B>()>::type, N / chunk_width<T, N, B>(),
                        (chunk_width<T, N, B>() > 1 && B < lane_bytes)>;

}  // namespace detail
}  // namespace cuticle

#endif  // CUTICLE_SIMD_CHUNK_H
