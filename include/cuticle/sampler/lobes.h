// A mixture of K product lobes at one viewer's inclination, which a sampler evaluates and draws from.
#ifndef CUTICLE_SAMPLER_LOBES_H
#define CUTICLE_SAMPLER_LOBES_H

#include "cuticle/sampler/circle.h"
#include "cuticle/sampler/normal.h"
#include "cuticle/sampler/sample.h"
#include "cuticle/simd/pack_math.h"

namespace cuticle {

// The two means are adjacent, and so are the two sigmas: both coordinates are evaluated as one pack.
enum LobeParameter { lobe_weight, lobe_mean_theta, lobe_mean_phi, lobe_sigma_theta, lobe_sigma_phi, lobe_parameters };

template <class Family, class Float> using DensityOf = typename Family::template Density<Float>;

// The factor that normalises a density's shape along one coordinate.
template <class Family, class Float> CUTICLE_HD Float density_norm(const DensityOf<Family, Float> &d) {
    return Float(Family::height) * d.rate * d.under / d.mass;
}

// One lobe along theta and along phi.
template <class Float, class Family = NormalLobes> struct ChosenLobe {
    DensityOf<Family, Float> theta, phi;
};

namespace detail {
template <class Mask> struct Select {
    const Mask &mask;
    template <class Float> CUTICLE_INLINE Float operator()(const Float &a, const Float &b) const {
        return select(mask, a, b);
    }
};
}  // namespace detail

template <class Family, class Float, class Mask>
CUTICLE_INLINE DensityOf<Family, Float> select_density(const Mask &mask, const DensityOf<Family, Float> &a,
                                                       const DensityOf<Family, Float> &b) {
    return DensityOf<Family, Float>::each(detail::Select<Mask>{mask}, a, b);
}

// The factor of a lobe's shape: its weight times the norms of both coordinates, given the products of their rates, of their
// masses and of the masses' denominators. An even lobe is halved, since it covers both signs. One division.
template <class Family, class Set>
CUTICLE_INLINE Set lobe_scale(const Set &weight, const Set &rates, const Set &masses, const Set &unders, bool even) {
    return weight * rates * Set(Family::height * Family::height * (even ? .5 : 1.)) * unders / masses;
}

// One lobe along theta and along phi, for mixtures that set up each lobe by itself. Not Fine: precise enough for the
// density only.
template <class Family, bool Fine = true, class Float>
CUTICLE_INLINE DensityOf<Family, Float> make_theta(const Float &mean, const Float &sigma) {
    const Float pole = Float(half_pi<double>);
    return Family::template make<Fine>(mean, sigma, Float(-pole), pole);
}
template <class Family, bool Fine = true, class Float>
CUTICLE_INLINE DensityOf<Family, Float> make_phi(const Float &mean, const Float &sigma, bool even) {
    const Float turn = Float(pi<double>);
    return Family::template make<Fine>(mean, sigma, even ? Float(0) : Float(mean - turn), even ? turn : Float(mean + turn));
}

// Its density in d theta_i d phi. `place` is in [-pi, pi], and is |phi| for even lobes.
template <class Family, class Float>
CUTICLE_INLINE Float lobe_density(const DensityOf<Family, Float> &theta, const DensityOf<Family, Float> &phi,
                                  const Float &scale, const Float &theta_i, const Float &place, bool even) {
    const Float d = place - phi.mean;
    const Float a = (theta_i - theta.mean) * theta.rate, b = (even ? d : short_way(d)) * phi.rate;
    return scale * Family::together(Family::along(a), Family::along(b));
}

template <class Family, class Float> CUTICLE_INLINE Float invert_theta(const DensityOf<Family, Float> &d, const Float &u) {
    // The float nearest to pi/2 lies past the pole: stay one ulp inside.
    const Float limit = Float(half_pi<Float> * (1 - epsilon<Float>));
    return math::clamp(Family::icdf(d, u, Float(-half_pi<Float>), Float(half_pi<Float>)), Float(-limit), limit);
}
// A periodic lobe is inverted from its own seam: a sample does not depend on where the circle starts.
template <class Family, class Float>
CUTICLE_INLINE Float invert_phi(const DensityOf<Family, Float> &d, const Float &u, bool even) {
    const Float turn = Float(pi<Float>);
    if (even) {
        const Float v = Float(2) * u - Float(1);
        return math::copysign(math::clamp(Family::icdf(d, Float(math::abs(v)), Float(0), turn), Float(0), turn), v);
    }
    const Float lo = d.mean - turn, hi = d.mean + turn;
    return math::wrap_angle(math::clamp(Family::icdf(d, u, lo, hi), lo, hi));
}

// One inverse cdf per coordinate; the mixture computes the pdf.
template <class Float, class Family>
CUTICLE_INLINE Sample<Float> draw(const ChosenLobe<Float, Family> &chosen, const Float &u_theta, const Float &u_phi,
                                  bool even) {
    return {invert_theta<Family>(chosen.theta, u_theta), invert_phi<Family>(chosen.phi, u_phi, even), Float(0)};
}

// Weights sum to 1, and sigmas are positive. A mean lies in its domain or at most one sigma outside, as the family's
// densities require: the table is checked node by node, and linear interpolation preserves it.
// Azimuth: if `even`, lobes are densities of |phi| on [0, pi] (as EvenNormal); else each covers the period around its mean
// (as PeriodicNormal), which is in [-2 pi, 2 pi].
template <class Float, int K, class Family = NormalLobes> struct Lobes {
    using Set = Pack<Float, K>;
    using Both = Pack<Float, 2 * K>;  // theta's, then phi's
    // The lobes of a scalar share vectors and are divided at once, off the critical path; of an array's lobes only the
    // chosen one is divided.
    static constexpr bool finished = std::is_arithmetic_v<Float>;
    Set weight, scale;
    DensityOf<Family, Both> both;
    bool even;

    CUTICLE_INLINE void set(const Set &weight_, const Both &mean, const Both &sigma, bool even_) {
        weight = weight_;
        even = even_;
        const Set pole(half_pi<double>), turn(pi<double>), mean_phi = half<1>(mean);
        const Set lo = even ? Set(0) : Set(mean_phi - turn), hi = even ? turn : Set(mean_phi + turn);
        both = Family::make(mean, sigma, join(Set(-pole), lo), join(pole, hi));
        const auto product = [](const Both &x) { return half<0>(x) * half<1>(x); };
        scale = lobe_scale<Family>(weight, product(both.rate), product(both.mass), product(both.under), even);
        if constexpr (finished) Family::divide(both);
    }

    CUTICLE_INLINE Float pdf(const Float &theta_i, const Float &phi_i) const {
        return per_steradian(density(theta_i, math::nearest_turn(phi_i)), theta_i);
    }

    // Density in d theta_i d phi; `wrapped` is in [-pi, pi].
    CUTICLE_INLINE Float density(const Float &theta_i, const Float &wrapped) const {
        Both d = join(Set(theta_i), Set(even ? math::abs(wrapped) : wrapped)) - both.mean;
        if (!even) d = join(half<0>(d), short_way(half<1>(d)));
        const Both shape = Family::along(Both(d * both.rate));
        return sum(Set(scale * Family::together(half<0>(shape), half<1>(shape))));
    }

    // One lobe's cdf in theta_i (from -pi/2) and in phi (from -pi), and their inverses.
    CUTICLE_HD Float cdf_theta(int k, const Float &x) const {
        return Family::cdf(theta(k), math::clamp(x, Float(-half_pi<Float>), Float(half_pi<Float>)));
    }
    CUTICLE_HD Float icdf_theta(int k, const Float &u) const { return invert_theta<Family>(theta(k), u); }
    CUTICLE_HD Float cdf_phi(int k, const Float &x) const {
        const DensityOf<Family, Float> d = phi(k);
        if (even) return even_cdf([&](const Float &y) { return Family::cdf(d, y); }, x);
        return periodic_cdf([&](const Float &y) { return Family::cdf(d, Float(d.mean + y)); }, d.mean, x);
    }
    CUTICLE_HD Float icdf_phi(int k, const Float &u) const {
        const DensityOf<Family, Float> d = phi(k);
        if (even) return invert_phi<Family>(d, u, even);
        return periodic_icdf([&](const Float &y) { return Family::cdf(d, Float(d.mean + y)); },
                             [&](const Float &v) {
                                 const Float turn = Float(pi<Float>);
                                 return Float(Family::icdf(d, v, Float(d.mean - turn), Float(d.mean + turn)) - d.mean);
                             },
                             d.mean, u);
    }

    // The lobe that u in [0, 1) chooses, along both coordinates.
    CUTICLE_INLINE ChosenLobe<Float, Family> choose(const Float &u_lobe) const {
        Float below[K];
        below[0] = weight[0];
        for (int k = 1; k < K; ++k) below[k] = below[k - 1] + weight[k];
        // u is scaled by the sum that was reached: rounding never selects past the last lobe, nor a lobe of weight 0.
        const Float u = u_lobe * below[K - 1];
        if constexpr (std::is_arithmetic_v<Float> && !CUTICLE_DEVICE) {
            int chosen = 0;
            for (int k = 0; k + 1 < K; ++k) chosen += static_cast<int>(u >= below[k]);
            return {theta(chosen), phi(chosen)};
        } else {
            ChosenLobe<Float, Family> chosen{theta(0), phi(0)};
            for (int k = 1; k < K; ++k) {
                const auto past = u >= below[k - 1];
                chosen = {select_density<Family, Float>(past, theta(k), chosen.theta),
                          select_density<Family, Float>(past, phi(k), chosen.phi)};
            }
            return chosen;
        }
    }

    CUTICLE_INLINE Sample<Float> sample(const Float &u_lobe, const Float &u_theta, const Float &u_phi) const {
        Sample<Float> s = draw(choose(u_lobe), u_theta, u_phi, even);
        s.pdf = sample_per_steradian(density(s.theta_i, s.phi), s.theta_i);
        return s;
    }

    // One lobe along one coordinate.
    CUTICLE_HD DensityOf<Family, Float> theta(int k) const { return one(k); }
    CUTICLE_HD DensityOf<Family, Float> phi(int k) const { return one(K + k); }

  private:
    CUTICLE_INLINE DensityOf<Family, Float> one(int i) const {
        const DensityOf<Family, Float> d = DensityOf<Family, Float>::each(Pick{i}, both);
        if constexpr (finished) return Family::divided(d);
        else return d;
    }
    // Through memory, to which the vector is written long before the choice is known; a subscript of the vector itself
    // would have to wait for the choice.
    struct Pick {
        int i;
        CUTICLE_INLINE Float operator()(const Both &x) const {
            if constexpr (std::is_arithmetic_v<Float>) {
                Float lanes[2 * K];
                for (int c = 0; c < Both::chunks; ++c) std::memcpy(lanes + c * Both::width, &x.v[c], sizeof x.v[c]);
                return lanes[i];
            } else {
                return x[i];
            }
        }
    };
};

}  // namespace cuticle

#endif  // CUTICLE_SAMPLER_LOBES_H
