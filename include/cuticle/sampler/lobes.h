// A mixture of K product lobes at one viewer's inclination: what a sampler evaluates and draws from.
#ifndef CUTICLE_SAMPLER_LOBES_H
#define CUTICLE_SAMPLER_LOBES_H

#include "cuticle/sampler/normal.h"
#include "cuticle/simd/pack_math.h"

namespace cuticle {

// Means side by side and sigmas side by side: both coordinates are worked on as one pack.
enum LobeParameter { lobe_weight, lobe_mean_theta, lobe_mean_phi, lobe_sigma_theta, lobe_sigma_phi, lobe_parameters };

template <class Float> struct Sample {
    Float theta_i, phi, pdf;  // radians, radians, 1/sr
};

// One lobe along theta and along phi.
template <class Float> struct ChosenLobe {
    CentralNormal<Float> theta, phi;
};

template <class Mask, class Float>
CUTICLE_HD CentralNormal<Float> select_normal(const Mask &mask, const CentralNormal<Float> &a,
                                              const CentralNormal<Float> &b) {
    return {select(mask, a.mean, b.mean), select(mask, a.rate, b.rate), select(mask, a.width, b.width),
            select(mask, a.low, b.low),   select(mask, a.mass, b.mass), select(mask, a.under, b.under)};
}

// Of two normals of height 1 times their rates; an even lobe is shared by either sign.
CUTICLE_INLINE constexpr double lobe_height(bool even) {
    return two_over_sqrt_pi<double> * two_over_sqrt_pi<double> * (even ? .5 : 1.);
}

// What a lobe's exp is multiplied by: its weight and the norms of both coordinates, given the products of their rates, of
// their masses and of what these are over. One division.
template <class Set>
CUTICLE_INLINE Set lobe_scale(const Set &weight, const Set &rates, const Set &masses, const Set &unders, bool even) {
    return weight * rates * Set(lobe_height(even)) * unders / masses;
}

// From a periodic lobe's mean, the short way round: of azimuths within half a turn and a whole turn of 0.
template <class Set> CUTICLE_INLINE Set short_way(const Set &d) {
    const Set limit(pi<double>), turn(2 * pi<double>);
    return select(d > limit, Set(d - turn), select(d < -limit, Set(d + turn), d));
}

// 1/sr from a density in d theta_i d phi: d omega = cos(theta_i) d theta_i d phi.
template <class Float> CUTICLE_INLINE Float per_steradian(const Float &density, const Float &theta_i) {
    return select(math::abs(theta_i) > Float(half_pi<Float>), Float(0), Float(density / math::cos_theta(theta_i)));
}
// The same for a sample: it lies inside, and 1/cos is ready before its density.
template <class Float> CUTICLE_INLINE Float sample_per_steradian(const Float &density, const Float &theta_i) {
    return density * (Float(1) / math::cos_theta(theta_i));
}

template <class Float> CUTICLE_INLINE Float invert_theta(const CentralNormal<Float> &d, const Float &u) {
    // The float nearest to pi/2 lies past the pole: stay one ulp inside.
    const Float limit = Float(half_pi<Float> * (1 - epsilon<Float>));
    return math::clamp(central_icdf(d, u, Float(-half_pi<Float>), Float(half_pi<Float>)), Float(-limit), limit);
}
// A periodic lobe is inverted from its own seam: any order of the circle serves a sample.
template <class Float> CUTICLE_INLINE Float invert_phi(const CentralNormal<Float> &d, const Float &u, bool even) {
    const auto inverse = [&](const Float &v, const Float &lo, const Float &hi) {
        return math::clamp(central_icdf(d, v, lo, hi), lo, hi);
    };
    if (even) return even_icdf([&](const Float &v) { return inverse(v, Float(0), Float(pi<Float>)); }, u);
    return math::wrap_angle(inverse(u, Float(d.mean - Float(pi<Float>)), Float(d.mean + Float(pi<Float>))));
}

// One inverse a coordinate; the pdf is left to the mixture.
template <class Float>
CUTICLE_INLINE Sample<Float> draw(const ChosenLobe<Float> &chosen, const Float &u_theta, const Float &u_phi, bool even) {
    return {invert_theta(chosen.theta, u_theta), invert_phi(chosen.phi, u_phi, even), Float(0)};
}

// Weights sum to 1; sigmas are positive; a mean lies in its domain or at most one sigma outside (the table is
// held to it node by node, and linear interpolation keeps it), so that CentralNormal serves.
// Azimuth: `even` takes |phi| on [0, pi] (EvenNormal), else each lobe its own period (PeriodicNormal), its mean within
// ±2 pi.
template <class Float, int K> struct Lobes {
    using Set = Pack<Float, K>;
    using Both = Pack<Float, 2 * K>;  // theta's, then phi's
    // A number's lobes lie in one vector, divided at once while nothing waits for them; of an array's lobes only the chosen
    // one is divided.
    static constexpr bool finished = std::is_arithmetic_v<Float>;
    Set weight, scale;
    CentralNormal<Both> normal;  // `under` is 1 where finished
    bool even;

    CUTICLE_INLINE void set(const Set &weight_, const Both &mean, const Both &sigma, bool even_) {
        weight = weight_;
        even = even_;
        const Set pole(half_pi<double>), turn(pi<double>), mean_phi = half<1>(mean);
        const Set lo = even ? Set(0) : Set(mean_phi - turn), hi = even ? turn : Set(mean_phi + turn);
        normal = central_normal(mean, sigma, join(Set(-pole), lo), join(pole, hi));
        const auto both = [](const Both &x) { return half<0>(x) * half<1>(x); };
        scale = lobe_scale(weight, both(normal.rate), both(normal.mass), both(normal.under), even);
        if constexpr (finished) {
            normal.low = normal.low / normal.under;
            normal.mass = normal.mass / normal.under;
        }
    }

    CUTICLE_INLINE Float pdf(const Float &theta_i, const Float &phi_i) const {
        return per_steradian(density(theta_i, math::nearest_turn(phi_i)), theta_i);
    }

    // In d theta_i d phi, at an azimuth within half a turn of 0.
    CUTICLE_INLINE Float density(const Float &theta_i, const Float &wrapped) const {
        Both d = join(Set(theta_i), Set(even ? math::abs(wrapped) : wrapped)) - normal.mean;
        if (!even) d = join(half<0>(d), short_way(half<1>(d)));
        const Both z = d * normal.rate, squared = z * z;
        return sum(Set(scale * math::decay(Set(-(half<0>(squared) + half<1>(squared))))));
    }

    // One lobe's cdf in theta_i (from -pi/2) and in phi (from -pi), and their inverses.
    CUTICLE_HD Float cdf_theta(int k, const Float &x) const {
        return central_cdf(theta(k), math::clamp(x, Float(-half_pi<Float>), Float(half_pi<Float>)));
    }
    CUTICLE_HD Float icdf_theta(int k, const Float &u) const { return invert_theta(theta(k), u); }
    CUTICLE_HD Float cdf_phi(int k, const Float &x) const {
        const CentralNormal<Float> d = phi(k);
        if (even) return even_cdf([&](const Float &y) { return central_cdf(d, y); }, x);
        return periodic_cdf([&](const Float &y) { return central_cdf(d, Float(d.mean + y)); }, d.mean, x);
    }
    CUTICLE_HD Float icdf_phi(int k, const Float &u) const {
        const CentralNormal<Float> d = phi(k);
        if (even) return invert_phi(d, u, even);
        return periodic_icdf([&](const Float &y) { return central_cdf(d, Float(d.mean + y)); },
                             [&](const Float &v) {
                                 const Float turn = Float(pi<Float>);
                                 return Float(central_icdf(d, v, Float(d.mean - turn), Float(d.mean + turn)) - d.mean);
                             },
                             d.mean, u);
    }

    // The lobe that u in [0, 1) chooses, along both coordinates.
    CUTICLE_INLINE ChosenLobe<Float> choose(const Float &u_lobe) const {
        Float below[K];
        below[0] = weight[0];
        for (int k = 1; k < K; ++k) below[k] = below[k - 1] + weight[k];
        // Scaled by the sum that was reached: rounding never leads past the last lobe, nor into one of weight 0.
        const Float u = u_lobe * below[K - 1];
        if constexpr (std::is_arithmetic_v<Float> && !CUTICLE_DEVICE) {
            int chosen = 0;
            for (int k = 0; k + 1 < K; ++k) chosen += static_cast<int>(u >= below[k]);
            return {theta(chosen), phi(chosen)};
        } else {
            ChosenLobe<Float> chosen{theta(0), phi(0)};
            for (int k = 1; k < K; ++k) {
                const auto past = u >= below[k - 1];
                chosen = {select_normal(past, theta(k), chosen.theta), select_normal(past, phi(k), chosen.phi)};
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
    CUTICLE_HD CentralNormal<Float> theta(int k) const { return one(k); }
    CUTICLE_HD CentralNormal<Float> phi(int k) const { return one(K + k); }

  private:
    CUTICLE_INLINE CentralNormal<Float> one(int i) const {
        return {pick(normal.mean, i), pick(normal.rate, i), pick(normal.width, i),
                pick(normal.low, i),  pick(normal.mass, i), finished ? Float(1) : pick(normal.under, i)};
    }
    // By way of memory, where a vector is laid down long before the choice is known: subscripted itself, it would wait for
    // it.
    CUTICLE_INLINE static Float pick(const Both &x, int i) {
        if constexpr (std::is_arithmetic_v<Float>) {
            Float lanes[2 * K];
            for (int c = 0; c < Both::chunks; ++c) std::memcpy(lanes + c * Both::width, &x.v[c], sizeof x.v[c]);
            return lanes[i];
        } else {
            return x[i];
        }
    }
};

}  // namespace cuticle

#endif  // CUTICLE_SAMPLER_LOBES_H
