// Mathematical functions of the core. One body serves float, double and array types.
//
// On the host, float uses polynomials without calls or branches, so that loops over lobes become vector instructions;
// double uses the standard library. An array type (Dr.Jit's, a pack) brings its own functions, found by argument-dependent
// lookup: sqrt in place of std::sqrt and, if it has faster ones, max, min and decay in place of those in math::defaults.
#ifndef CUTICLE_MATH_FUNCTIONS_H
#define CUTICLE_MATH_FUNCTIONS_H

#include "cuticle/math/config.h"

namespace cuticle {

// An array type (Dr.Jit's, a pack) specialises this. Its operators, select(mask, a, b) and functions such as sqrt or erf
// are found in its own namespace.
template <class T> struct ArrayTraits {
    using Scalar = T;   // one lane
    using Index = int;  // a lane's index into memory
    static CUTICLE_HD Index to_index(const T &x) { return static_cast<int>(x); }
    template <class Memory> static CUTICLE_HD T gather(const Memory &memory, const Index &index) { return T(memory[index]); }
    // Whether any lane is set; true for a traced array, whose lanes are not known yet.
    static CUTICLE_HD bool any(bool mask) { return mask; }
    // while (condition(state)) body(state); each lane runs as long as its own condition holds.
    template <class State, class Condition, class Body>
    static CUTICLE_HD void loop(State &state, const Condition &condition, const Body &body) {
        while (condition(state)) body(state);
    }
};
template <class T> using scalar_t = typename ArrayTraits<T>::Scalar;

// Constants of a lane.
template <class Float> inline constexpr scalar_t<Float> pi = scalar_t<Float>(3.14159265358979323846);
template <class Float> inline constexpr scalar_t<Float> half_pi = scalar_t<Float>(1.57079632679489661923);
template <class Float> inline constexpr scalar_t<Float> sqrt_half = scalar_t<Float>(0.70710678118654752440);
template <class Float> inline constexpr scalar_t<Float> two_over_sqrt_pi = scalar_t<Float>(1.12837916709551257390);
// Values of std::numeric_limits as constants: device code may not call its functions.
template <class Float> inline constexpr scalar_t<Float> epsilon = std::numeric_limits<scalar_t<Float>>::epsilon();
template <class Float> inline constexpr scalar_t<Float> smallest = std::numeric_limits<scalar_t<Float>>::min();
template <class Float> inline constexpr scalar_t<Float> largest = std::numeric_limits<scalar_t<Float>>::max();

// Array types overload this for their mask.
CUTICLE_HD inline float select(bool mask, float a, float b) { return mask ? a : b; }
CUTICLE_HD inline double select(bool mask, double a, double b) { return mask ? a : b; }
CUTICLE_HD inline int select(bool mask, int a, int b) { return mask ? a : b; }

namespace math {

template <class T> CUTICLE_HD T sqrt(const T &x) {
    using std::sqrt;
    return sqrt(x);
}
template <class T> CUTICLE_HD T log(const T &x) {
    using std::log;
    return log(x);
}
template <class T> CUTICLE_HD T sin(const T &x) {
    using std::sin;
    return sin(x);
}
template <class T> CUTICLE_HD T cos(const T &x) {
    using std::cos;
    return cos(x);
}
template <class T> CUTICLE_HD T asin(const T &x) {
    using std::asin;
    return asin(x);
}
template <class T> CUTICLE_HD T abs(const T &x) {
    using std::abs;
    return abs(x);
}
template <class T> CUTICLE_HD T floor(const T &x) {
    using std::floor;
    return floor(x);
}
template <class T> CUTICLE_HD T atan2(const T &y, const T &x) {
    using std::atan2;
    return atan2(y, x);
}
template <class T> CUTICLE_HD T copysign(const T &x, const T &sign) {
    using std::copysign;
    return copysign(x, sign);
}
template <class T> CUTICLE_HD T exp(const T &x) {
    using std::exp;
    return exp(x);
}

namespace defaults {
template <class T> CUTICLE_INLINE T max(const T &a, const T &b) { return select(a < b, b, a); }
template <class T> CUTICLE_INLINE T min(const T &a, const T &b) { return select(b < a, b, a); }
template <class T> CUTICLE_INLINE T decay(const T &x) { return math::exp(x); }
}  // namespace defaults

template <class T> CUTICLE_INLINE T max(const T &a, const T &b) {
    using defaults::max;
    return max(a, b);
}
template <class T> CUTICLE_INLINE T min(const T &a, const T &b) {
    using defaults::min;
    return min(a, b);
}
template <class T> CUTICLE_INLINE T clamp(const T &x, const T &lo, const T &hi) { return min(max(x, lo), hi); }
template <class T> CUTICLE_HD T sqr(const T &x) { return x * x; }

// Σ c[i] x^i, highest degree first.
template <class T> CUTICLE_INLINE T polynomial(const T &, const T &c) { return c; }
template <class T, class... Rest>
CUTICLE_INLINE T polynomial(const T &x, const T &high, const T &next, const Rest &...rest) {
    return polynomial(x, T(high * x + next), rest...);
}

// The same by Estrin's scheme: a few more multiplications, half the latency of Horner's.
template <int N, class T> CUTICLE_INLINE T estrin(const T &x, const T (&c)[N]) {
    if constexpr (N == 1) {
        return c[0];
    } else {
        constexpr int odd = N % 2, half = (N + 1) / 2;
        T pairs[half];
        if constexpr (odd) pairs[0] = c[0];
        for (int i = odd; i < half; ++i) pairs[i] = c[2 * i - odd] * x + c[2 * i + 1 - odd];
        return estrin(T(x * x), pairs);
    }
}

// 2^n for the integer n nearest to t <= 0, and n itself.
CUTICLE_HD inline float round_power(const float &t, float &rounded) {
    const float held = t > -127.f ? t : -127.f;  // NaN, too
    const std::int32_t n = static_cast<std::int32_t>((held < 127.f ? held : 127.f) - .5f);
    rounded = static_cast<float>(n);
    const std::uint32_t bits = static_cast<std::uint32_t>(n + 127) << 23;
    float power;
    std::memcpy(&power, &bits, sizeof power);
    return power;
}

// exp(x) for x <= 0; densities need no other exponents. In single precision: 2^n times a minimax polynomial of degree 5 on
// [-½ ln 2, ½ ln 2] (benchmarks/fit_polynomials.py), relative error below 3e-7. It never falls below 9e-27, so that no
// product with it becomes a denormal, which would cost more than everything else together.
template <class T> CUTICLE_INLINE T decay_single(const T &x_) {
    const T x = max(x_, T(-60.f));
    T n;
    const T power = round_power(T(x * T(1.44269504f)), n);
    const T r = (x - n * T(.693145752f)) - n * T(1.42860677e-6f);  // ln 2 in two parts
    const T c[] = {T(8.2976479e-3f), T(4.19154323e-2f), T(.166675751f), T(.499988944f), T(.999999692f), T(1.00000007f)};
    return power * estrin(r, c);
}

template <class T> CUTICLE_INLINE T decay(const T &x) {
    using defaults::decay;
    return decay(x);
}

CUTICLE_HD inline float decay(float x) {
#if CUTICLE_DEVICE
    return ::expf(x);
#else
    return decay_single(x);
#endif
}

// 1 - exp(-x) for x >= 0, given the exponential. In single precision a series replaces the difference at small x.
template <class T> CUTICLE_INLINE T one_less_decay(const T &x, const T &decayed) {
    const T whole = T(1) - decayed;
    if constexpr (!std::is_same_v<scalar_t<T>, float>) {
        return whole;
    } else {
        const T few =
            x * polynomial(x, T(1.f / 5040), T(-1.f / 720), T(1.f / 120), T(-1.f / 24), T(1.f / 6), T(-.5f), T(1.f));
        return select(x < T(.5f), few, whole);
    }
}

// log of a normal float x > 0: the exponent times ln 2, plus r times a minimax polynomial in r = m - 1 on [√½ - 1, √2 - 1)
// (benchmarks/fit_polynomials.py); relative error below 4e-7. A library call would double the cost of an inverse cdf.
CUTICLE_INLINE float split_power(const float &x, float &exponent) {
    std::uint32_t bits;
    std::memcpy(&bits, &x, sizeof bits);
    const std::int32_t n = static_cast<std::int32_t>(bits - 0x3f3504f3u) >> 23;
    const std::uint32_t scaled = bits - (static_cast<std::uint32_t>(n) << 23);
    exponent = static_cast<float>(n);
    float mantissa;
    std::memcpy(&mantissa, &scaled, sizeof mantissa);
    return mantissa;
}
template <class T> CUTICLE_INLINE T log_single(const T &x) {
    T n;
    const T r = split_power(x, n) - T(1.f);
    const T c[] = {T(-.101068966f), T(.162225857f), T(-.172508314f), T(.199001655f),
                   T(-.249699086f), T(.333350599f), T(-.500003636f), T(.99999994f)};
    return n * T(.693147181f) + r * estrin(r, c);
}
CUTICLE_INLINE float log(float x) { return log_single(x); }

// Reduces an angle by whole turns to [-pi, pi], up to rounding.
template <class T> CUTICLE_INLINE T nearest_turn(const T &x) {
    return x - T(2 * pi<double>) * math::floor(T(x * T(.5 / pi<double>) + T(.5)));
}

// Reduces an angle to (-pi, pi].
template <class T> CUTICLE_INLINE T wrap_angle(const T &x) {
    const T r = nearest_turn(x);
    return clamp(T(select(r <= T(-pi<T>), T(pi<T>), r)), T(-pi<T>), T(pi<T>));
}

// Linear interpolation: a at t = 0, b at t = 1.
template <class Value, class Float> CUTICLE_INLINE Value linear(const Value &a, const Value &b, const Float &t) {
    return a + t * (b - a);
}
// The same as a convex combination: rounding never makes it negative for a, b >= 0.
template <class Value, class Float> CUTICLE_INLINE Value convex(const Value &a, const Value &b, const Float &t) {
    return (Float(1) - t) * a + t * b;
}
template <class Value, class Float>
CUTICLE_INLINE Value bilinear(const Value &a0, const Value &a1, const Value &b0, const Value &b1, const Float &t,
                              const Float &u) {
    return convex(convex(a0, a1, u), convex(b0, b1, u), t);
}

// sin on [-pi/2, pi/2], minimax of degree 9 (benchmarks/fit_polynomials.py), error below 1e-7.
template <class T> CUTICLE_INLINE T sin_single(const T &x) {
    const T t = x * x;
    return x * polynomial(t, T(2.60190274e-6f), T(-1.98074186e-4f), T(8.33302514e-3f), T(-.166666567f), T(1.f));
}

// copysign by selection, for languages without that function.
template <class T> CUTICLE_INLINE T copysign_chosen(const T &x, const T &sign) {
    const T size = math::abs(x);
    return select(sign < T(0), T(-size), size);
}

// sin and cos of any angle, error below 2e-7; for vectors, and for shaders, whose own may be off by 5e-4.
template <class T> CUTICLE_INLINE T sin_turned(const T &x) {
    const T r = nearest_turn(x), size = math::abs(r);
    return copysign_chosen(sin_single(min(size, T(T(pi<T>) - size))), r);
}
template <class T> CUTICLE_INLINE T cos_turned(const T &x) {
    return sin_single(T(T(half_pi<T>) - math::abs(nearest_turn(x))));
}

// cos(theta) for |theta| <= pi/2 with full relative precision up to the poles, where the plain cosine of the float next to
// pi/2 is negative. At least the type's epsilon, so that 1/cos stays finite.
template <class T> CUTICLE_INLINE T cos_theta_single(const T &theta) {
    const T x = (T(half_pi<T>) - math::abs(theta)) - T(4.37113883e-8f);
    return max(sin_single(x), T(epsilon<T>));
}

template <class T> CUTICLE_INLINE T cos_theta(const T &theta) {
    if constexpr (std::is_same_v<scalar_t<T>, float>) {  // a GPU's own sine is known to 5e-7 absolutely
        return cos_theta_single(theta);
    } else {
        constexpr double low = 1.57079632679489661923 - static_cast<double>(half_pi<T>);
        const T x = (T(half_pi<T>) - math::abs(theta)) + T(low);
        return max(T(math::sin(x)), T(epsilon<T>));
    }
}

}  // namespace math

// A position among nodes: the node below it, and the fraction of the way to the next.
template <class Float> struct Place {
    typename ArrayTraits<Float>::Index node;
    Float t;
};

// Whether any lane is above a limit; NaN counts as above.
template <class T> CUTICLE_INLINE bool any_above(const T &x, const T &limit) {
    if constexpr (std::is_arithmetic_v<T>) return !(x <= limit);
    else return ArrayTraits<T>::any(select(x <= limit, T(0), T(1)) > T(0));
}

// x rounded down and clamped to [0, last], for any bits of x; every table look-up goes through here. The order of the
// comparisons makes NaN give 0.
template <class Float> CUTICLE_INLINE typename ArrayTraits<Float>::Index truncated(const Float &x, int last) {
    return ArrayTraits<Float>::to_index(math::min(math::max(Float(0), x), Float(last)));
}
// Clamps the integer as well where the compiler may swap comparisons with NaN (-ffast-math, shaders).
template <class Index> CUTICLE_INLINE Index held_index(const Index &i, int last) {
    return CUTICLE_ORDERS_NAN ? i : Index(math::min(math::max(Index(0), i), Index(last)));
}
template <class Float> CUTICLE_INLINE typename ArrayTraits<Float>::Index index_below(const Float &x, int last) {
    return held_index(truncated(x, last), last);
}

// Locates a position among `count` nodes at 0, 1, ..., clamped to the ends. NaN stays NaN in the fraction.
template <class Float> CUTICLE_INLINE Place<Float> locate_node(const Float &place, int count) {
    const auto node = truncated(place, count - 2);
    return {held_index(node, count - 2), math::clamp(place, Float(0), Float(count - 1)) - Float(node)};
}

}  // namespace cuticle

#endif  // CUTICLE_MATH_FUNCTIONS_H
