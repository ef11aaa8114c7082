// The sampler over arrays: directions side by side in the lanes of a vector, through the same lines as a single one.
// Fast where the compiler has vectors (GCC, Clang; float); elsewhere a plain loop.
#ifndef CUTICLE_SAMPLER_BATCH_H
#define CUTICLE_SAMPLER_BATCH_H

#include "cuticle/sampler/row.h"

namespace cuticle {

namespace detail {

// One lobe's density, each of its numbers in every lane: lobe by lobe all stays in registers.
template <class Lanes> struct LaneLobe {
    Lanes weight, scale;
    CentralNormal<Lanes> theta, phi;

    LaneLobe() = default;
    template <int K>
    CUTICLE_INLINE LaneLobe(const LobeValues<Lanes, K> &values, int k, bool even)
        : weight(values.weight[k]),
          theta(theta_normal<false>(values.mean[k], values.sigma[k])),
          phi(phi_normal<false>(values.mean[K + k], values.sigma[K + k], even)) {
        scale = lobe_scale(weight, Lanes(theta.rate * phi.rate), Lanes(theta.mass * phi.mass),
                           Lanes(theta.under * phi.under), even);
    }

    // In d theta_i d phi; `place` is |phi| for even lobes, and within half a turn of 0.
    CUTICLE_INLINE Lanes density(const Lanes &theta_i, const Lanes &place, bool even) const {
        const Lanes d = place - phi.mean;
        const Lanes a = (theta_i - theta.mean) * theta.rate, b = (even ? d : short_way(d)) * phi.rate;
        return scale * math::decay(Lanes(-(a * a + b * b)));
    }
};

// What lanes do with a mixture that knows its `count`, whether it is `even`, and of each lobe `lobe(k)`, its `weight(k)`
// and how to `choose` one.
template <class Mixture, class Lanes> struct LaneSampler {
    CUTICLE_INLINE Lanes pdf(const Lanes &theta_i, const Lanes &phi) const {
        return per_steradian(density(theta_i, math::nearest_turn(phi)), theta_i);
    }
    CUTICLE_INLINE Sample<Lanes> sample(const Lanes &u_lobe, const Lanes &u_theta, const Lanes &u_phi) const {
        Sample<Lanes> s = direction(u_lobe, u_theta, u_phi);
        s.pdf = sample_per_steradian(density(s.theta_i, s.phi), s.theta_i);
        return s;
    }
    // Without its pdf.
    CUTICLE_INLINE Sample<Lanes> direction(const Lanes &u_lobe, const Lanes &u_theta, const Lanes &u_phi) const {
        // Scaled by the sum that is reached in this very order, as in Lobes::choose: never into a lobe of weight 0.
        Lanes total = self().weight(0), below = Lanes(0);
        for (int k = 1; k < self().count; ++k) total = total + self().weight(k);
        const Lanes u = u_lobe * total;
        const auto past = [&](int k) {  // asked for k = 1, 2, ... once each
            below = k == 1 ? self().weight(0) : below + self().weight(k - 1);
            return u >= below;
        };
        return draw(self().choose(past), u_theta, u_phi, self().even);  // its pdf is 0 yet
    }

  private:
    CUTICLE_INLINE const Mixture &self() const { return static_cast<const Mixture &>(*this); }
    // In d theta_i d phi, at an azimuth within half a turn of 0.
    CUTICLE_INLINE Lanes density(const Lanes &theta_i, const Lanes &wrapped) const {
        const bool even = self().even;
        const Lanes place = even ? math::abs(wrapped) : wrapped;
        Lanes total = Lanes(0);
        for (int k = 0; k < self().count; ++k) total = total + self().lobe(k).density(theta_i, place, even);
        return total;
    }
};

// The lobes of a mixture, made one by one as they are asked for.
template <class Lanes, int K> struct LaneMixture : LaneSampler<LaneMixture<Lanes, K>, Lanes> {
    static constexpr int count = K;
    const LobeValues<Lanes, K> &values;
    bool even;

    CUTICLE_INLINE LaneMixture(const LobeValues<Lanes, K> &values_, bool even_) : values(values_), even(even_) {}
    CUTICLE_INLINE LaneLobe<Lanes> lobe(int k) const { return {values, k, even}; }
    CUTICLE_INLINE const Lanes &weight(int k) const { return values.weight.v[k]; }
    // Its mean and sigma alone wait for the choice.
    template <class Choice> CUTICLE_INLINE ChosenLobe<Lanes> choose(const Choice &past) const {
        Lanes mean[2] = {values.mean[0], values.mean[K]}, sigma[2] = {values.sigma[0], values.sigma[K]};
        for (int k = 1; k < K; ++k) {
            const auto mask = past(k);
            for (int i = 0; i < 2; ++i) {
                mean[i] = select(mask, values.mean[i * K + k], mean[i]);
                sigma[i] = select(mask, values.sigma[i * K + k], sigma[i]);
            }
        }
        return {theta_normal<true>(mean[0], sigma[0]), phi_normal<true>(mean[1], sigma[1], even)};
    }
};

// The lobes of one shading point; a blend of two mixtures is one mixture of all their lobes.
template <class Lanes, class T, int K> struct LanePoint : LaneSampler<LanePoint<Lanes, T, K>, Lanes> {
    LaneLobe<Lanes> lobes[2 * K];
    int count;
    bool even;

    CUTICLE_INLINE explicit LanePoint(const PreparedSampler<T, K> &sampler)
        : count(sampler.blended ? 2 * K : K), even(sampler.first.even) {
        for (int k = 0; k < K; ++k) {
            set(lobes[k], sampler.first, k, sampler.share);
            if (sampler.blended) set(lobes[K + k], sampler.second, k, sampler.rest);
        }
    }
    CUTICLE_INLINE const LaneLobe<Lanes> &lobe(int k) const { return lobes[k]; }
    CUTICLE_INLINE const Lanes &weight(int k) const { return lobes[k].weight; }
    template <class Choice> CUTICLE_INLINE ChosenLobe<Lanes> choose(const Choice &past) const {
        ChosenLobe<Lanes> chosen{lobes[0].theta, lobes[0].phi};
        for (int k = 1; k < count; ++k) {
            const auto mask = past(k);
            chosen = {select_normal(mask, lobes[k].theta, chosen.theta), select_normal(mask, lobes[k].phi, chosen.phi)};
        }
        return chosen;
    }

  private:
    CUTICLE_INLINE static CentralNormal<Lanes> spread(const CentralNormal<T> &d) {
        return {Lanes(d.mean), Lanes(d.rate), Lanes(d.width), Lanes(d.low), Lanes(d.mass), Lanes(d.under)};
    }
    CUTICLE_INLINE static void set(LaneLobe<Lanes> &to, const Lobes<T, K> &from, int k, const T &share) {
        to.weight = Lanes(from.weight[k] * share);
        to.scale = Lanes(from.scale[k] * share);
        to.theta = spread(from.theta(k));
        to.phi = spread(from.phi(k));
    }
};

// A sample without its pdf, where that is to be had for less.
template <class Mixture, class Lanes>
CUTICLE_INLINE Sample<Lanes> direction(const LaneSampler<Mixture, Lanes> &mixture, const Lanes &u_lobe, const Lanes &u_theta,
                                       const Lanes &u_phi) {
    return mixture.direction(u_lobe, u_theta, u_phi);
}
template <class Lanes, int K>
CUTICLE_INLINE Sample<Lanes> direction(const PreparedSampler<Lanes, K> &blend, const Lanes &u_lobe, const Lanes &u_theta,
                                       const Lanes &u_phi) {
    return blend.sample(u_lobe, u_theta, u_phi);
}

// body(first, how many, mixture at their viewers and numbers of strands) for groups that fill the lanes.
template <class T, int K, class Body>
CUTICLE_INLINE void each_group(const LobeTable<T, K> &table, std::size_t count, const T *theta_r, const T *strands,
                               bool each, const Body &body) {
    using Lanes = BatchLanes<T>;
    const RowPosition<T> all = locate_row(table, each ? T(0) : strands[0]);
    if (!each && !is_blended(table, all) && OneRow<T, K>::serves(table, count)) {
        const OneRow<T, K> row(table, all);
        return groups<Lanes>(count, [&](std::size_t i, int n) {
            const LobeValues<Lanes, K> values = row(locate_theta(table, read<Lanes>(theta_r + i, n)));
            body(i, n, LaneMixture<Lanes, K>(values, table.even));
        });
    }
    groups<Lanes>(count, [&](std::size_t i, int n) {
        const ThetaPosition<Lanes> at = locate_theta(table, read<Lanes>(theta_r + i, n));
        const RowPosition<Lanes> rows = locate_row(table, each ? read<Lanes>(strands + i, n) : Lanes(strands[0]));
        if (is_blended(table, rows)) return body(i, n, prepare_blended(table, at, rows));
        const LobeValues<Lanes, K> values = values_at(table, at, rows);
        body(i, n, LaneMixture<Lanes, K>(values, table.even));
    });
}

}  // namespace detail

// pdf of `count` directions in 1/sr. Structure of arrays; `strands` is one number for all or, with `each`, an array. What is
// written overlaps nothing that is read.
template <class T, int K>
void pdf_batch(const LobeTable<T, K> &table, std::size_t count, const T *theta_i, const T *theta_r, const T *phi,
               const T *strands, bool each, T *out) {
    if constexpr (CUTICLE_NATIVE_PACK && std::is_same_v<T, float>) {
        using Lanes = BatchLanes<T>;
#if CUTICLE_NATIVE_SHUFFLE
        const RowPosition<T> row = locate_row(table, each ? T(0) : strands[0]);
        if (!each && detail::RowDensities<K>::serves(table, row, count))
            return detail::RowDensities<K>(table, row).pdf(count, theta_i, theta_r, phi, out);
#endif
        detail::each_group(table, count, theta_r, strands, each, [&](std::size_t i, int n, const auto &mixture) {
            const auto get = [&](const T *from) { return detail::read<Lanes>(from + i, n); };
            detail::write(mixture.pdf(get(theta_i), get(phi)), out + i, n);
        });
    } else {
        for (std::size_t i = 0; i < count; ++i)
            out[i] = pdf(table, theta_i[i], theta_r[i], phi[i], each ? strands[i] : strands[0]);
    }
}

// `count` samples with their pdf.
template <class T, int K>
void sample_batch(const LobeTable<T, K> &table, std::size_t count, const T *theta_r, const T *u_lobe, const T *u_theta,
                  const T *u_phi, const T *strands, bool each, T *theta_i, T *phi, T *density) {
    if constexpr (CUTICLE_NATIVE_PACK && std::is_same_v<T, float>) {
        using Lanes = BatchLanes<T>;
        const auto sample_groups = [&](const auto &of) {
            detail::each_group(table, count, theta_r, strands, each, [&](std::size_t i, int n, const auto &mixture) {
                const auto get = [&](const T *from) { return detail::read<Lanes>(from + i, n); };
                const Sample<Lanes> s = of(mixture, get(u_lobe), get(u_theta), get(u_phi));
                detail::write(s.theta_i, theta_i + i, n);
                detail::write(s.phi, phi + i, n);
                detail::write(s.pdf, density + i, n);
            });
        };
#if CUTICLE_NATIVE_SHUFFLE
        // One or two lobes' densities cost less than the way by a row, where these are looked up anyway.
        const RowPosition<T> row = locate_row(table, each ? T(0) : strands[0]);
        if (K > 2 && !each && detail::RowDensities<K>::serves(table, row, count)) {
            sample_groups([](const auto &mixture, const auto &...u) { return detail::direction(mixture, u...); });
            return detail::RowDensities<K>(table, row).pdf(count, theta_i, theta_r, phi, density);
        }
#endif
        sample_groups([](const auto &mixture, const auto &...u) { return mixture.sample(u...); });
    } else {
        for (std::size_t i = 0; i < count; ++i) {
            const Sample<T> s = sample(table, theta_r[i], u_lobe[i], u_theta[i], u_phi[i], each ? strands[i] : strands[0]);
            theta_i[i] = s.theta_i, phi[i] = s.phi, density[i] = s.pdf;
        }
    }
}

// The same for directions of one shading point, `sampler` prepared for it: nothing is looked up again.
template <class T, int K>
void pdf_batch(const PreparedSampler<T, K> &sampler, std::size_t count, const T *theta_i, const T *phi, T *out) {
    if constexpr (CUTICLE_NATIVE_PACK && std::is_same_v<T, float>) {
        using Lanes = BatchLanes<T>;
        const detail::LanePoint<Lanes, T, K> point(sampler);
        detail::groups<Lanes>(count, [&](std::size_t i, int n) {
            const auto get = [&](const T *from) { return detail::read<Lanes>(from + i, n); };
            detail::write(point.pdf(get(theta_i), get(phi)), out + i, n);
        });
    } else {
        for (std::size_t i = 0; i < count; ++i) out[i] = sampler.pdf(theta_i[i], phi[i]);
    }
}

template <class T, int K>
void sample_batch(const PreparedSampler<T, K> &sampler, std::size_t count, const T *u_lobe, const T *u_theta, const T *u_phi,
                  T *theta_i, T *phi, T *density) {
    if constexpr (CUTICLE_NATIVE_PACK && std::is_same_v<T, float>) {
        using Lanes = BatchLanes<T>;
        const detail::LanePoint<Lanes, T, K> point(sampler);
        detail::groups<Lanes>(count, [&](std::size_t i, int n) {
            const auto get = [&](const T *from) { return detail::read<Lanes>(from + i, n); };
            const Sample<Lanes> s = point.sample(get(u_lobe), get(u_theta), get(u_phi));
            detail::write(s.theta_i, theta_i + i, n);
            detail::write(s.phi, phi + i, n);
            detail::write(s.pdf, density + i, n);
        });
    } else {
        for (std::size_t i = 0; i < count; ++i) {
            const Sample<T> s = sampler.sample(u_lobe[i], u_theta[i], u_phi[i]);
            theta_i[i] = s.theta_i, phi[i] = s.phi, density[i] = s.pdf;
        }
    }
}

}  // namespace cuticle

#endif  // CUTICLE_SAMPLER_BATCH_H
