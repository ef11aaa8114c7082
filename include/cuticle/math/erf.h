// The error function, its inverse and its complement, for float, double and array types.
#ifndef CUTICLE_MATH_ERF_H
#define CUTICLE_MATH_ERF_H

#include "cuticle/math/functions.h"

namespace cuticle {
namespace math {

// A quotient whose division is deferred, so that several divisions can be merged into one.
template <class T> struct Quotient {
    T over, under;
};

// erf in single precision as x P(x²)/Q(x²) for |x| <= erf_limit; minimax fits of benchmarks/fit_polynomials.py.
// Fine: relative error 3e-8 before rounding and 4e-7 after it; the result is at most 1 + 2e-7.
// Not Fine: one coefficient fewer, 1.4e-7 before rounding. That suffices for a norm, but not for a cdf that is inverted
// near its ends.
template <bool Fine> inline constexpr float erf_limit = Fine ? 4.f : 3.7f;
template <bool Fine, class T> CUTICLE_INLINE Quotient<T> erf_held(const T &x) {
    const T t = x * x;
    if constexpr (Fine) {
        const T p = polynomial(t, T(1.98677e-6f), T(2.84569745e-4f), T(3.88347404e-3f), T(5.31021431e-2f), T(.193547979f),
                               T(1.12837911f));
        const T q =
            polynomial(t, T(3.74202609e-5f), T(1.1856046e-3f), T(1.52075076e-2f), T(.115351215f), T(.504859984f), T(1.f));
        return {x * p, q};
    } else {
        const T p = polynomial(t, T(2.48201453e-4f), T(6.68660458e-3f), T(6.11835495e-2f), T(.2715922f), T(1.12837899f));
        const T q =
            polynomial(t, T(1.51734121e-5f), T(1.68678479e-3f), T(2.08148323e-2f), T(.145586446f), T(.574021041f), T(1.f));
        return {x * p, q};
    }
}
template <class T> CUTICLE_INLINE Quotient<T> erf_single(const T &x) {
    return erf_held<true>(clamp(x, T(-erf_limit<true>), T(erf_limit<true>)));
}

template <class T> CUTICLE_INLINE Quotient<T> erf_quotient(const T &x) {
    if constexpr (std::is_same_v<scalar_t<T>, float>) {
        return erf_single(x);
    } else {
        using std::erf;
        return {erf(x), T(1)};
    }
}

// erf at an end of an interval around a mean. A lower end can only pass the negative limit, an upper end only the positive
// one, so each is clamped on one side.
template <bool Lower, bool Fine, class T> CUTICLE_INLINE Quotient<T> erf_end(const T &x) {
    if constexpr (std::is_same_v<scalar_t<T>, float>)
        return erf_held<Fine>(Lower ? max(x, T(-erf_limit<Fine>)) : min(x, T(erf_limit<Fine>)));
    else return erf_quotient(x);
}

template <class T> CUTICLE_INLINE T erf(const T &x) {
    const Quotient<T> q = erf_quotient(x);
    return q.over / q.under;
}

// erfinv(p) / p to single precision as a function of w = -ln(1 - p²), after M. Giles, "Approximating the erfinv function"
// (2010). For w < 5, where |p| <= .9966: his polynomial by Estrin's scheme, which has half the latency of Horner's. Beyond:
// a polynomial in √w of our own, up to w = 38 (benchmarks/fit_polynomials.py), which is rarely needed.
template <class T> CUTICLE_INLINE T erfinv_depth(const T &p) {
    return -math::log(max(T((T(1) - p) * (T(1) + p)), T(5e-17)));
}
template <class T> CUTICLE_INLINE T erfinv_central(const T &w) {
    const T x = w - T(2.5), x2 = x * x, x4 = x2 * x2;
    return (T(2.81022636e-08) * x4 +
            polynomial(x2, T(T(3.43273939e-07) * x + T(-3.5233877e-06)), T(T(-4.39150654e-06) * x + T(0.00021858087)))) *
               x4 +
           polynomial(x2, T(T(-0.00125372503) * x + T(-0.00417768164)), T(T(0.246640727) * x + T(1.50140941)));
}
template <class T> CUTICLE_INLINE T erfinv_tail(const T &w) {
    const T x = math::sqrt(max(w, T(5))) - T(4);
    return polynomial(x, T(-1.60476247e-06), T(1.94593467e-05), T(-6.70821682e-05), T(8.13514271e-05), T(-5.72178978e-05),
                      T(.000271576137), T(-.000914475415), T(.00128535682), T(1.00950396), T(3.839782));
}
template <class T> CUTICLE_INLINE T erfinv_single(const T &p) {
    const T w = erfinv_depth(p), central = erfinv_central(w);
    if (!ArrayTraits<T>::any(w > T(5))) return p * central;
    return p * select(w < T(5), central, erfinv_tail(w));
}

// exp(x²) erfc(x) for x >= 0 in single precision, as t P(t) with t = 1/(1 + x/2); relative error 7e-7 before rounding for x
// up to 8 (benchmarks/fit_polynomials.py).
template <class T> CUTICLE_INLINE T erfcx_single(const T &x) {
    const T t = T(1) / (T(1) + T(.5) * x);
    const T c[] = {T(.0921253413f), T(-.370669425f), T(.408955753f), T(.0237087235f),
                   T(.28692919f),   T(.276540101f),  T(.282409608f)};
    return t * estrin(t, c);
}
template <class T> CUTICLE_INLINE T erfc_single(const T &x) { return math::decay(T(-x * x)) * erfcx_single(x); }

template <class T> CUTICLE_HD T erfc(const T &x) {
    using std::erfc;
    return erfc(x);
}

// erfc(x) for x >= 0, to a relative precision.
template <class T> CUTICLE_INLINE T erfc_positive(const T &x) {
    if constexpr (std::is_same_v<scalar_t<T>, float>) return erfc_single(x);
    else return math::erfc(x);
}

// erfinv(p) to the precision of the type; double precision adds two Halley steps on erf. Arguments that rounding pushed
// outside [-1, 1] are clamped (in single precision by the max in erfinv_depth).
template <class T> CUTICLE_INLINE T erfinv(const T &p_) {
    if constexpr (std::is_same_v<scalar_t<T>, float>) {
        return erfinv_single(p_);
    } else {
        const T p = clamp(p_, T(-1), T(1));
        T z = erfinv_single(p);
        for (int step = 0; step < 2; ++step) {
            const T e = (math::erf(z) - p) / (T(two_over_sqrt_pi<T>) * math::exp(T(-z * z)));
            z = z - e / (T(1) + z * e);
        }
        return z;
    }
}

// erfinv(p), where w is erfinv_depth(p) and at most 5.
template <class T> CUTICLE_INLINE T erfinv_shallow(const T &p, const T &w) {
    if constexpr (std::is_same_v<scalar_t<T>, float>) return p * erfinv_central(w);
    else return erfinv(p);
}

// The z of erfc(z) = q for q <= .0034, where p = 1 - q has lost digits; what lies below 2.5e-17 is taken for that.
template <class T> CUTICLE_INLINE T erfcinv_small(const T &q_) {
    const T q = max(q_, T(2.5e-17));
    T z = (T(1) - q) * erfinv_tail(T(-math::log(T(q * (T(2) - q)))));
    if constexpr (!std::is_same_v<scalar_t<T>, float>) {
        for (int step = 0; step < 2; ++step) {
            const T e = (q - erfc_positive(z)) / (T(two_over_sqrt_pi<T>) * math::exp(T(-z * z)));
            z = z - e / (T(1) + z * e);
        }
    }
    return z;
}

// Scaled complementary error function exp(x²) erfc(x) for x >= 0. Below 3: the polynomial or, in double precision, the
// product, whose factors neither overflow nor underflow there. From 3 on: the continued fraction of erfc (DLMF 7.9.3),
// evaluated from its tail.
template <class T> CUTICLE_HD T erfcx(const T &x) {
    const T lower = min(x, T(3)), upper = max(x, T(3));
    T tail = upper;
    for (int k = 40; k >= 1; --k) tail = upper + T(.5 * k) / tail;
    tail = T(0.56418958354775628695) / tail;
    if constexpr (std::is_same_v<scalar_t<T>, float>) return select(x < T(3), erfcx_single(lower), tail);
    else return select(x < T(3), T(math::exp(T(lower * lower)) * math::erfc(lower)), tail);
}

}  // namespace math
}  // namespace cuticle

#endif  // CUTICLE_MATH_ERF_H
