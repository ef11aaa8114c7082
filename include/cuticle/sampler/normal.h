// One-dimensional densities per radian, each with pdf, cdf and icdf: the truncated normal, as the lobes of a mixture use it
// and for any mean; from it the longitudinal lobe on [-pi/2, pi/2] and the azimuthal lobes on the circle.
#ifndef CUTICLE_SAMPLER_NORMAL_H
#define CUTICLE_SAMPLER_NORMAL_H

#include "cuticle/math/erf.h"
#include "cuticle/sampler/circle.h"

namespace cuticle {

// The family of normal lobes, which shows what a mixture needs of a family. A lobe is a product of two densities, one along
// theta and one along phi. `Density` is one of them, set up; with z = (x - mean) rate its value is
//     height rate under / mass times its part of together(along(z_theta), along(z_phi)).
// Members and functions serve numbers, array types and packs.
//
// Here the density is a normal truncated to [lo, hi]. Its mean lies inside or at most one sigma outside, where the
// difference of two erf keeps its precision.
struct NormalLobes {
    template <class Float> struct Density {
        Float mean, rate, width;  // width = sqrt 2 sigma, rate = 1 / width
        Float low, mass, under;   // low/under is erf at the lower end, mass/under erf(upper) - erf(lower)

        // Applies `use` to each member of one density, or to the same member of several.
        template <class Use, class... Densities> CUTICLE_INLINE static auto each(const Use &use, const Densities &...d) {
            return Density<decltype(use(d.mean...))>{use(d.mean...), use(d.rate...), use(d.width...),
                                                     use(d.low...),  use(d.mass...), use(d.under...)};
        }
    };

    static constexpr double height = two_over_sqrt_pi<double>;
    static constexpr double deviation = sqrt_half<double>;  // sigma rate

    // Not Fine: precise enough for the density only.
    template <bool Fine = true, class Float>
    CUTICLE_INLINE static Density<Float> make(const Float &mean, const Float &sigma, const Float &lo, const Float &hi) {
        const Float rate = Float(deviation) / sigma;
        const math::Quotient<Float> a = math::erf_end<true, Fine>(Float((lo - mean) * rate));
        const math::Quotient<Float> b = math::erf_end<false, Fine>(Float((hi - mean) * rate));
        const Float low = a.over * b.under;
        return {mean, rate, Float(2 * sqrt_half<double>) * sigma, low, b.over * a.under - low, a.under * b.under};
    }

    // The density's shape along one coordinate. `together` of `along` gives that of both coordinates with one exp.
    template <class Float> CUTICLE_INLINE static Float shape(const Float &z) { return math::decay(Float(-z * z)); }
    template <class Float> CUTICLE_INLINE static Float along(const Float &z) { return z * z; }
    template <class Float> CUTICLE_INLINE static Float together(const Float &theta, const Float &phi) {
        return math::decay(Float(-(theta + phi)));
    }
    // -d ln(shape) / dz, for a fit's derivatives.
    template <class Float> CUTICLE_HD static Float fall(const Float &z) { return Float(2) * z; }

    // `divide` does the divisions that need not wait for the choice of a lobe; `divided` then makes `under`, now 1, a
    // constant.
    template <class Float> CUTICLE_INLINE static void divide(Density<Float> &d) {
        d.low = d.low / d.under;
        d.mass = d.mass / d.under;
    }
    template <class Float> CUTICLE_INLINE static Density<Float> divided(const Density<Float> &d) {
        return {d.mean, d.rate, d.width, d.low, d.mass, Float(1)};
    }

    template <class Float> CUTICLE_HD static Float cdf(const Density<Float> &d, const Float &x) {
        const Float p = math::erf(Float((x - d.mean) * d.rate));
        return math::clamp(Float((p * d.under - d.low) / d.mass), Float(0), Float(1));
    }
    // The inverse cdf on [lo, hi]. Far out in a tail, where erf rounds to ±1, the probability beyond x is taken from the
    // nearer end of the interval: erfc there plus the share of the mass in between.
    template <class Float>
    CUTICLE_INLINE static Float icdf(const Density<Float> &d, const Float &u, const Float &lo, const Float &hi) {
        const Float p = (d.low + u * d.mass) / d.under, w = math::erfinv_depth(p);
        const Float central = math::erfinv_shallow(p, w);
        if (!ArrayTraits<Float>::any(w > Float(5))) return d.mean + d.width * central;
        const auto lower = p < Float(0);
        const Float end = math::max(Float(select(lower, Float(d.mean - lo), Float(hi - d.mean)) * d.rate), Float(0));
        const Float beyond = math::erfc_positive(end) + select(lower, u, Float(Float(1) - u)) * (d.mass / d.under);
        const Float tail = math::erfcinv_small(beyond);
        return d.mean + d.width * select(w < Float(5), central, Float(select(lower, Float(-tail), tail)));
    }
};

// The normal of any mean and any sigma > 0, truncated to [lo, hi]. If the mean lies more than a sigma outside, everything
// is relative to the density at the nearer end and uses erfcx, which never over- or underflows, however far the mean.
template <class Float> struct TruncatedNormal {
    Float lo, hi;
    NormalLobes::Density<Float> central;
    Float nearer, sign;  // the end next to the mean, and the direction from it into the interval
    Float z_near;        // its distance to the mean in units of 1/rate
    Float erfcx_near, tail_far, tail_mass;
    decltype(Float(0) < Float(0)) in_tail;

    CUTICLE_HD TruncatedNormal(const Float &mean, const Float &sigma, const Float &lo_, const Float &hi_)
        : lo(lo_), hi(hi_) {
        const Float below = lo - mean, above = mean - hi;
        in_tail = math::max(below, above) > sigma;
        central = NormalLobes::make(Float(select(in_tail, Float(Float(.5) * (lo + hi)), mean)), sigma, lo, hi);
        nearer = select(below > above, lo, hi);
        sign = select(below > above, Float(1), Float(-1));
        z_near = math::max(Float(math::max(below, above) * central.rate), Float(0));
        erfcx_near = math::erfcx(z_near);
        tail_far = scaled_tail(Float((hi - lo) * central.rate));
        tail_mass = erfcx_near - tail_far;
    }

    CUTICLE_HD Float pdf(const Float &x) const {
        const Float z = (x - central.mean) * central.rate;
        const Float d = sign * (x - nearer) * central.rate;
        const Float density = select(
            in_tail,
            Float(Float(two_over_sqrt_pi<Float>) * central.rate / tail_mass *
                  math::decay(Float(-d * (z_near + z_near + d)))),
            Float(Float(NormalLobes::height) * central.rate * central.under / central.mass * math::decay(Float(-z * z))));
        return select(x < lo, Float(0), select(x > hi, Float(0), density));
    }

    CUTICLE_HD Float cdf(const Float &x_) const {
        const Float x = math::clamp(x_, lo, hi);
        const Float inside = (erfcx_near - scaled_tail(Float(sign * (x - nearer) * central.rate))) / tail_mass;
        const Float tail = select(sign > Float(0), inside, Float(Float(1) - inside));
        return math::clamp(Float(select(in_tail, tail, NormalLobes::cdf(central, x))), Float(0), Float(1));
    }

    CUTICLE_HD Float icdf(const Float &u_) const {
        const Float u = math::clamp(u_, Float(0), Float(1));
        const Float v = select(sign > Float(0), u, Float(Float(1) - u));
        // Newton's method on -ln erfc(z), convex and increasing: from an overestimate it descends to the root.
        const Float target = -math::log(math::max(Float((Float(1) - v) + v * tail_far / erfcx_near), Float(1e-37)));
        const Float length = (hi - lo) * central.rate;
        Float d = math::min(Float(target / math::max(Float(z_near + z_near), Float(1))), length);
        for (int step = 0; step < 8; ++step) {
            const Float e = math::erfcx(Float(z_near + d));
            const Float excess = d * (z_near + z_near + d) - math::log(Float(e / erfcx_near)) - target;
            d = math::clamp(Float(d - excess * e / Float(two_over_sqrt_pi<Float>)), Float(0), length);
        }
        const Float tail = nearer + sign * d / central.rate;
        return math::clamp(Float(select(in_tail, tail, NormalLobes::icdf(central, u, lo, hi))), lo, hi);
    }

  private:
    // erfc at distance d / rate from the near end, over exp(-z_near²).
    CUTICLE_HD Float scaled_tail(const Float &d) const {
        return math::decay(Float(-d * (z_near + z_near + d))) * math::erfcx(Float(z_near + d));
    }
};

// Longitudinal lobe: a normal in theta truncated to [-pi/2, pi/2]; densities per radian of theta.
template <class Float> CUTICLE_HD TruncatedNormal<Float> longitudinal_normal(const Float &mean, const Float &sigma) {
    return {mean, sigma, Float(-half_pi<Float>), Float(half_pi<Float>)};
}

// Azimuthal lobe on the circle: a normal truncated to the one period centred on its mean.
template <class Float> struct PeriodicNormal {
    Float mean;
    TruncatedNormal<Float> centred;

    CUTICLE_HD PeriodicNormal(const Float &mean_, const Float &sigma)
        : mean(math::wrap_angle(mean_)), centred(Float(0), sigma, Float(-pi<Float>), Float(pi<Float>)) {}
    CUTICLE_HD Float pdf(const Float &phi) const { return centred.pdf(math::wrap_angle(Float(phi - mean))); }
    CUTICLE_HD Float cdf(const Float &phi) const {
        return periodic_cdf([this](const Float &d) { return centred.cdf(d); }, mean, phi);
    }
    CUTICLE_HD Float icdf(const Float &u) const {
        return periodic_icdf([this](const Float &d) { return centred.cdf(d); },
                             [this](const Float &v) { return centred.icdf(v); }, mean, u);
    }
};

// Azimuthal lobe of a scattering function that is even in phi: a normal in |phi| truncated to [0, pi], with either sign
// equally likely. With mean pi it equals the periodic normal. With any other mean, one lobe with one exp represents the
// pair at +mean and -mean (TRT's glints); with a mean past pi, a one-sided rise.
template <class Float> struct EvenNormal {
    TruncatedNormal<Float> half;

    CUTICLE_HD EvenNormal(const Float &mean, const Float &sigma) : half(mean, sigma, Float(0), Float(pi<Float>)) {}
    CUTICLE_HD Float pdf(const Float &phi) const { return Float(.5) * half.pdf(math::abs(math::wrap_angle(phi))); }
    CUTICLE_HD Float cdf(const Float &phi) const {
        return even_cdf([this](const Float &x) { return half.cdf(x); }, phi);
    }
    CUTICLE_HD Float icdf(const Float &u) const {
        return even_icdf([this](const Float &v) { return half.icdf(v); }, u);
    }
};

}  // namespace cuticle

#endif  // CUTICLE_SAMPLER_NORMAL_H
