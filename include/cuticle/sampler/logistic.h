// The family of logistic lobes. Their tails are heavier than a normal's; exp and log replace erf and its inverse.
#ifndef CUTICLE_SAMPLER_LOGISTIC_H
#define CUTICLE_SAMPLER_LOGISTIC_H

#include "cuticle/math/functions.h"

namespace cuticle {

// The logistic distribution truncated to [lo, hi], with the interface of NormalLobes. `sigma` is its deviation before
// truncation.
//
// Let a = (mean - lo) rate and b = (hi - mean) rate. The tails beyond the ends follow from e^-a and e^-b, and the mass
// between them from 1 - e^-(a + b), which depends on the interval's length only. No sum has terms of opposite signs, so
// neither end loses precision. A mean at most one sigma outside has a and b >= -pi/√3.
struct LogisticLobes {
    template <class Float> struct Density {
        Float mean, rate, width;  // width = √3/pi sigma, rate = 1 / width
        Float low, high;          // low/under is the probability below the interval, high/under above it
        Float mass, under;        // mass/under is the probability inside it

        template <class Use, class... Densities> CUTICLE_INLINE static auto each(const Use &use, const Densities &...d) {
            return Density<decltype(use(d.mean...))>{use(d.mean...), use(d.rate...), use(d.width...), use(d.low...),
                                                     use(d.high...), use(d.mass...), use(d.under...)};
        }
    };

    static constexpr double height = 1;
    static constexpr double deviation = 1.81379936423421785059;  // pi/√3

    // e^-x for x >= -2: decay takes no positive exponent.
    template <class Float> CUTICLE_INLINE static Float end(const Float &x) {
        return Float(7.38905609893065022723) * math::decay(Float(-(x + Float(2))));
    }

    template <bool Fine = true, class Float>
    CUTICLE_INLINE static Density<Float> make(const Float &mean, const Float &sigma, const Float &lo, const Float &hi) {
        const Float rate = Float(deviation) / sigma;
        const Float a = end(Float((mean - lo) * rate)), b = end(Float((hi - mean) * rate)), one = Float(1);
        const Float mass = math::one_less_decay(Float((hi - lo) * rate), Float(a * b));
        return {mean, rate, sigma * Float(1 / deviation), a * (one + b), b * (one + a), mass, (one + a) * (one + b)};
    }

    // e/(1 + e)², e = exp(-|z|).
    template <class Float> CUTICLE_INLINE static Float shape(const Float &z) {
        const Float e = math::decay(Float(-math::abs(z)));
        return e / math::sqr(Float(Float(1) + e));
    }
    template <class Float> CUTICLE_INLINE static Float along(const Float &z) { return shape(z); }
    template <class Float> CUTICLE_INLINE static Float together(const Float &theta, const Float &phi) { return theta * phi; }
    template <class Float> CUTICLE_HD static Float fall(const Float &z) {
        const Float e = math::decay(Float(-math::abs(z)));
        return math::copysign(Float((Float(1) - e) / (Float(1) + e)), z);
    }

    // Nothing can be divided early: its only division needs u.
    template <class Float> CUTICLE_INLINE static void divide(Density<Float> &) {}
    template <class Float> CUTICLE_INLINE static Density<Float> divided(const Density<Float> &d) { return d; }

    template <class Float> CUTICLE_HD static Float cdf(const Density<Float> &d, const Float &x) {
        const Float z = (x - d.mean) * d.rate, e = math::decay(Float(-math::abs(z))), one = Float(1);
        const Float below = select(z < Float(0), e, one) / (one + e);
        return math::clamp(Float((below * d.under - d.low) / d.mass), Float(0), one);
    }
    template <class Float>
    CUTICLE_INLINE static Float icdf(const Density<Float> &d, const Float &u, const Float &, const Float &) {
        const Float below = d.low + u * d.mass, above = d.high + (Float(1) - u) * d.mass;
        return d.mean + d.width * math::log(Float(below / above));
    }
};

}  // namespace cuticle

#endif  // CUTICLE_SAMPLER_LOGISTIC_H
