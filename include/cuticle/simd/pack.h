// A pack of N values of a scalar type, which serves wherever the core takes a scalar: the lobes of a mixture are evaluated
// as one Pack by the same code as a single number. Packs of float and double are made of the compiler's vectors where it
// has them (GCC and Clang, on the host); packs of other types are arrays with loops.
#ifndef CUTICLE_SIMD_PACK_H
#define CUTICLE_SIMD_PACK_H

#include "cuticle/simd/chunk.h"

namespace cuticle {

template <int N> struct PackIndex;

// B: bytes of its widest vectors. Packs of lobes use at most 32, since they are joined, halved and summed.
template <class T, int N, int B = CUTICLE_VECTOR_BYTES < 32 ? CUTICLE_VECTOR_BYTES : 32>
struct Pack : detail::ChunksOf<T, N, B> {
    static constexpr int width = detail::chunk_width<T, N, B>(), chunks = N / width;
    using Chunk = typename detail::Chunk<T, width>::type;
    using detail::ChunksOf<T, N, B>::v;

    Pack() = default;
    // Takes numbers by value: device code may not bind a reference to a constant.
    CUTICLE_INLINE explicit Pack(std::conditional_t<std::is_arithmetic_v<T>, T, const T &> x) { fill(x); }
    template <class S, class = std::enable_if_t<std::is_arithmetic_v<S> && !std::is_same_v<S, T>>>
    CUTICLE_INLINE explicit Pack(S x) {
        fill(T(x));
    }
    CUTICLE_INLINE explicit Pack(const PackIndex<N> &x) {
#if CUTICLE_NATIVE_PACK
        if constexpr (std::is_same_v<T, float> && width > 1) {
            CUTICLE_UNROLL
            for (int i = 0; i < chunks; ++i) {
                typename detail::NativeChunk<width>::Integer n;
                std::memcpy(&n, x.v + i * width, sizeof n);
                v[i] = __builtin_convertvector(n, Chunk);
            }
            return;
        }
#endif
        for (int i = 0; i < N; ++i) set(i, T(x.v[i]));
    }
    CUTICLE_INLINE void fill(const T &x) {
        CUTICLE_UNROLL
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

template <class T, int N, int B> struct PackMask {
    typename detail::Chunk<T, Pack<T, N, B>::width>::Mask m[Pack<T, N, B>::chunks];
};

// Indices at which lanes read a table. Operations work on whole chunks: a whole load after partial stores stalls.
template <int N> struct PackIndex {
    static constexpr int width = detail::chunk_width<std::int32_t, N, CUTICLE_VECTOR_BYTES>();
    using Chunk = typename detail::Chunk<std::int32_t, width>::type;
    std::int32_t v[N];

    PackIndex() = default;
    CUTICLE_INLINE explicit PackIndex(int x) {
        for (int i = 0; i < N; i += width) put(i, x - Chunk{});
    }
    CUTICLE_INLINE Chunk chunk(int first) const {
        Chunk x;
        std::memcpy(&x, v + first, sizeof x);
        return x;
    }
    CUTICLE_INLINE void put(int first, const Chunk &x) { std::memcpy(v + first, &x, sizeof x); }
};

// A pack as an array type: what each lane does by itself.
template <class T, int N, int B> struct ArrayTraits<Pack<T, N, B>> {
    using Scalar = scalar_t<T>;
    using Index = PackIndex<N>;
    static CUTICLE_INLINE Index to_index(const Pack<T, N, B> &x) {
        Index r;
#if CUTICLE_NATIVE_PACK
        if constexpr (std::is_same_v<T, float> && Pack<T, N, B>::width > 1) {
            constexpr int width = Pack<T, N, B>::width;
            CUTICLE_UNROLL
            for (int i = 0; i < Pack<T, N, B>::chunks; ++i) {
                const auto n = __builtin_convertvector(x.v[i], typename detail::NativeChunk<width>::Integer);
                std::memcpy(r.v + i * width, &n, sizeof n);
            }
            return r;
        }
#endif
        for (int i = 0; i < N; ++i) r.v[i] = static_cast<std::int32_t>(x[i]);
        return r;
    }
    template <class Memory> static CUTICLE_INLINE Pack<T, N, B> gather(const Memory &memory, const Index &index) {
        Pack<T, N, B> r;
        for (int i = 0; i < N; ++i) r.set(i, T(memory[index.v[i]]));
        return r;
    }
    static CUTICLE_INLINE bool any(const PackMask<T, N, B> &mask) {
        bool found = false;
        CUTICLE_UNROLL
        for (const auto &chunk : mask.m)
#if CUTICLE_NATIVE_PACK
            if constexpr (Pack<T, N, B>::width > 1) found |= detail::any_bit(chunk);
            else
#endif
                found |= ArrayTraits<T>::any(chunk);
        return found;
    }
    // All lanes take every step; finished lanes discard it. State::apply(use) passes its members to `use`, in order.
    template <class State, class Condition, class Body>
    static CUTICLE_INLINE void loop(State &state, const Condition &condition, const Body &body) {
        for (;;) {
            const auto going = condition(state);
            if (!any(going)) return;
            State next = state;
            body(next);
            state.apply(
                [&](auto &...now) { next.apply([&](const auto &...then) { ((now = select(going, then, now)), ...); }); });
        }
    }
};

#define CUTICLE_PACK_BINARY(op)                                                                \
    template <class T, int N, int B>                                                           \
    CUTICLE_INLINE Pack<T, N, B> operator op(const Pack<T, N, B> &a, const Pack<T, N, B> &b) { \
        Pack<T, N, B> r;                                                                       \
        CUTICLE_UNROLL                                                                         \
        for (int i = 0; i < Pack<T, N, B>::chunks; ++i) r.v[i] = a.v[i] op b.v[i];             \
        return r;                                                                              \
    }
CUTICLE_PACK_BINARY(+)
CUTICLE_PACK_BINARY(-)
CUTICLE_PACK_BINARY(*)
CUTICLE_PACK_BINARY(/)
#undef CUTICLE_PACK_BINARY

#define CUTICLE_PACK_COMPARE(op)                                                                   \
    template <class T, int N, int B>                                                               \
    CUTICLE_INLINE PackMask<T, N, B> operator op(const Pack<T, N, B> &a, const Pack<T, N, B> &b) { \
        PackMask<T, N, B> r;                                                                       \
        CUTICLE_UNROLL                                                                             \
        for (int i = 0; i < Pack<T, N, B>::chunks; ++i) r.m[i] = a.v[i] op b.v[i];                 \
        return r;                                                                                  \
    }
CUTICLE_PACK_COMPARE(<)
CUTICLE_PACK_COMPARE(>)
CUTICLE_PACK_COMPARE(<=)
CUTICLE_PACK_COMPARE(>=)
#undef CUTICLE_PACK_COMPARE

template <class T, int N, int B>
CUTICLE_INLINE PackMask<T, N, B> operator&(const PackMask<T, N, B> &a, const PackMask<T, N, B> &b) {
    PackMask<T, N, B> r;
    CUTICLE_UNROLL
    for (int i = 0; i < Pack<T, N, B>::chunks; ++i) r.m[i] = a.m[i] & b.m[i];
    return r;
}

template <class T, int N, int B> CUTICLE_INLINE Pack<T, N, B> operator-(const Pack<T, N, B> &a) {
    Pack<T, N, B> r;
    CUTICLE_UNROLL
    for (int i = 0; i < Pack<T, N, B>::chunks; ++i) r.v[i] = -a.v[i];
    return r;
}

template <class T, int N, int B>
CUTICLE_INLINE Pack<T, N, B> select(const PackMask<T, N, B> &mask, const Pack<T, N, B> &a, const Pack<T, N, B> &b) {
    Pack<T, N, B> r;
    CUTICLE_UNROLL
    for (int i = 0; i < Pack<T, N, B>::chunks; ++i)
        if constexpr (Pack<T, N, B>::width > 1) r.v[i] = mask.m[i] ? a.v[i] : b.v[i];
        else r.v[i] = select(mask.m[i], a.v[i], b.v[i]);
    return r;
}

template <class T, int N, class To = Pack<T, N>> CUTICLE_INLINE To load_pack(const T *data) {
    To r;
    CUTICLE_UNROLL
    for (int i = 0; i < To::chunks; ++i)
        if constexpr (std::is_arithmetic_v<T>) std::memcpy(&r.v[i], data + i * To::width, sizeof r.v[i]);
        else r.v[i] = data[i];
    return r;
}

// join concatenates two packs; half returns the first (Part 0) or the second half.
template <class T, int N, int B> CUTICLE_INLINE Pack<T, 2 * N, B> join(const Pack<T, N, B> &a, const Pack<T, N, B> &b) {
    using From = Pack<T, N, B>;
    Pack<T, 2 * N, B> r;
    if constexpr (Pack<T, 2 * N, B>::width == From::width) {
        CUTICLE_UNROLL
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
template <int Part, class T, int N, int B> CUTICLE_INLINE Pack<T, N / 2, B> half(const Pack<T, N, B> &a) {
    using To = Pack<T, N / 2, B>;
    To r;
    if constexpr (To::width == Pack<T, N, B>::width) {
        CUTICLE_UNROLL
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

// Adds halves, which shortens the chain of dependent additions.
template <class T, int N, int B> CUTICLE_INLINE T sum(const Pack<T, N, B> &a) {
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

}  // namespace cuticle

#endif  // CUTICLE_SIMD_PACK_H
