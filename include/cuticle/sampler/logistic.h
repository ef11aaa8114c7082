// The family of logistic lobes: heavier tails than the normal's, exp and log in place of erf and its inverse.
#ifndef CUTICLE_SAMPLER_LOGISTIC_H
#define CUTICLE_SAMPLER_LOGISTIC_H

#include "cuticle/math/functions.h"

namespace cuticle {

// The logistic distribution truncated to [lo, hi], in the terms of NormalLobes; `sigma` is its deviation before it is cut
// off.
//
// With a = (mean - lo) rate, b = (hi - mean) rate and F(z) = 1/(1 + e^-z) the ends are told by e^-a and e^-b, the mass
// between them by 1 - e^-(a + b), of the interval's length alone: all sums are of one sign, so that neither end loses
// digits. A mean at most one sigma outside has a and b >= -pi/√3.
struct LogisticLobes {
    template <class Float> struct Density {
        Float mean, rate, width;  // width = √3/pi sigma, rate = 1 / width
        Float low, high;          // low/under is what lies below the interval, high/under what lies above
        Float mass, under;        // mass/under what lies in it

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

    // Its one division needs u.
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
