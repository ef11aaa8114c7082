// The sampler over arrays: each lane of a vector holds a direction, evaluated by the code for a single one.
// Fast for float where the compiler has vectors (GCC, Clang); elsewhere a plain loop.
#ifndef CUTICLE_SAMPLER_BATCH_H
#define CUTICLE_SAMPLER_BATCH_H

#include "cuticle/sampler/sampler.h"

namespace cuticle {

namespace detail {

// One lobe with each parameter in all lanes. Evaluated lobe by lobe, a mixture stays in registers.
template <class Lanes, class Family> struct LaneLobe {
    Lanes weight, scale;
    DensityOf<Family, Lanes> theta, phi;

    LaneLobe() = default;
    template <int K>
    CUTICLE_INLINE LaneLobe(const LobeValues<Lanes, K> &values, int k, bool even)
        : weight(values.weight[k]),
          theta(make_theta<Family, false>(values.mean[k], values.sigma[k])),
          phi(make_phi<Family, false>(values.mean[K + k], values.sigma[K + k], even)) {
        scale = lobe_scale<Family>(weight, Lanes(theta.rate * phi.rate), Lanes(theta.mass * phi.mass),
                                   Lanes(theta.under * phi.under), even);
    }

    // Density in d theta_i d phi. `place` is in [-pi, pi], and is |phi| for even lobes.
    CUTICLE_INLINE Lanes density(const Lanes &theta_i, const Lanes &place, bool even) const {
        return lobe_density<Family>(theta, phi, scale, theta_i, place, even);
    }
};

// Density and samples in lanes, for a Mixture with `count`, `even`, `lobe(k)`, `weight(k)` and `choose`.
template <class Mixture, class Lanes> struct LaneSampler {
    CUTICLE_INLINE Lanes pdf(const Lanes &theta_i, const Lanes &phi) const {
        return per_steradian(density(theta_i, math::nearest_turn(phi)), theta_i);
    }
    CUTICLE_INLINE Sample<Lanes> sample(const Lanes &u_lobe, const Lanes &u_theta, const Lanes &u_phi) const {
        // u is scaled by the sum in this very order, as in Lobes::choose, so that it never selects a lobe of weight 0.
        Lanes total = self().weight(0), below = Lanes(0);
        for (int k = 1; k < self().count; ++k) total = total + self().weight(k);
        const Lanes u = u_lobe * total;
        const auto past = [&](int k) {  // called for k = 1, 2, ... once each
            below = k == 1 ? self().weight(0) : below + self().weight(k - 1);
            return u >= below;
        };
        Sample<Lanes> s = draw(self().choose(past), u_theta, u_phi, self().even);
        s.pdf = sample_per_steradian(density(s.theta_i, s.phi), s.theta_i);
        return s;
    }

  private:
    CUTICLE_INLINE const Mixture &self() const { return static_cast<const Mixture &>(*this); }
    // Density in d theta_i d phi; `wrapped` is in [-pi, pi].
    CUTICLE_INLINE Lanes density(const Lanes &theta_i, const Lanes &wrapped) const {
        const bool even = self().even;
        const Lanes place = even ? math::abs(wrapped) : wrapped;
        Lanes total = Lanes(0);
        for (int k = 0; k < self().count; ++k) total = total + self().lobe(k).density(theta_i, place, even);
        return total;
    }
};

// A mixture whose lobes are set up one by one, when they are used.
template <class Lanes, int K, class Family> struct LaneMixture : LaneSampler<LaneMixture<Lanes, K, Family>, Lanes> {
    static constexpr int count = K;
    const LobeValues<Lanes, K> &values;
    bool even;

    CUTICLE_INLINE LaneMixture(const LobeValues<Lanes, K> &values_, bool even_) : values(values_), even(even_) {}
    CUTICLE_INLINE LaneLobe<Lanes, Family> lobe(int k) const { return {values, k, even}; }
    CUTICLE_INLINE const Lanes &weight(int k) const { return values.weight.v[k]; }
    // Selects mean and sigma only; the chosen lobe is set up afterwards.
    template <class Choice> CUTICLE_INLINE ChosenLobe<Lanes, Family> choose(const Choice &past) const {
        Lanes mean[2] = {values.mean[0], values.mean[K]}, sigma[2] = {values.sigma[0], values.sigma[K]};
        for (int k = 1; k < K; ++k) {
            const auto mask = past(k);
            for (int i = 0; i < 2; ++i) {
                mean[i] = select(mask, values.mean[i * K + k], mean[i]);
                sigma[i] = select(mask, values.sigma[i * K + k], sigma[i]);
            }
        }
        return {make_theta<Family>(mean[0], sigma[0]), make_phi<Family>(mean[1], sigma[1], even)};
    }
};

// The lobes of both rows, weighed by their shares, as those of one mixture.
template <class Lanes, int K>
CUTICLE_INLINE void join_rows(const BlendedRows<Lanes, K> &rows, LobeValues<Lanes, 2 * K> &out) {
    for (int k = 0; k < K; ++k) {
        out.weight.v[k] = rows.share * rows.first.weight.v[k];
        out.weight.v[K + k] = rows.rest * rows.second.weight.v[k];
        for (int i = 0; i < 2; ++i) {  // theta's, then phi's
            out.mean.v[2 * i * K + k] = rows.first.mean.v[i * K + k];
            out.mean.v[(2 * i + 1) * K + k] = rows.second.mean.v[i * K + k];
            out.sigma.v[2 * i * K + k] = rows.first.sigma.v[i * K + k];
            out.sigma.v[(2 * i + 1) * K + k] = rows.second.sigma.v[i * K + k];
        }
    }
}

// The lobes at one shading point. A blend of two mixtures becomes one mixture of all their lobes.
template <class Lanes, class T, int K, class Family> struct LanePoint : LaneSampler<LanePoint<Lanes, T, K, Family>, Lanes> {
    LaneLobe<Lanes, Family> lobes[2 * K];
    int count;
    bool even;

    CUTICLE_INLINE explicit LanePoint(const PreparedSampler<T, K, Family> &sampler)
        : count(sampler.blended ? 2 * K : K), even(sampler.first.even) {
        for (int k = 0; k < K; ++k) {
            set(lobes[k], sampler.first, k, sampler.share);
            if (sampler.blended) set(lobes[K + k], sampler.second, k, sampler.rest);
        }
    }
    CUTICLE_INLINE const LaneLobe<Lanes, Family> &lobe(int k) const { return lobes[k]; }
    CUTICLE_INLINE const Lanes &weight(int k) const { return lobes[k].weight; }
    template <class Choice> CUTICLE_INLINE ChosenLobe<Lanes, Family> choose(const Choice &past) const {
        ChosenLobe<Lanes, Family> chosen{lobes[0].theta, lobes[0].phi};
        for (int k = 1; k < count; ++k) {
            const auto mask = past(k);
            chosen = {select_density<Family, Lanes>(mask, lobes[k].theta, chosen.theta),
                      select_density<Family, Lanes>(mask, lobes[k].phi, chosen.phi)};
        }
        return chosen;
    }

  private:
    struct Spread {
        CUTICLE_INLINE Lanes operator()(const T &x) const { return Lanes(x); }
    };
    CUTICLE_INLINE static void set(LaneLobe<Lanes, Family> &to, const Lobes<T, K, Family> &from, int k, const T &share) {
        to.weight = Lanes(from.weight[k] * share);
        to.scale = Lanes(from.scale[k] * share);
        to.theta = DensityOf<Family, Lanes>::each(Spread{}, from.theta(k));
        to.phi = DensityOf<Family, Lanes>::each(Spread{}, from.phi(k));
    }
};

// Calls body(first, count, mixture) for groups that fill the lanes, with the mixture at their viewers and strand counts.
template <class T, int K, class Family, class Body>
CUTICLE_INLINE void each_group(const LobeTable<T, K, const T *, Family> &table, std::size_t count, const T *theta_r,
                               const T *strands, bool each, const Body &body) {
    using Lanes = BatchLanes<T>;
    const RowPosition<T> all = locate_row(table, each ? T(0) : strands[0]);
    if (!each && !is_blended(table, all))  // one row serves all lanes
        return groups<Lanes>(count, [&](std::size_t i, int n) {
            const LobeValues<Lanes, K> values = values_at(table, locate_theta(table, read<Lanes>(theta_r + i, n)), all);
            body(i, n, LaneMixture<Lanes, K, Family>(values, table.even));
        });
    groups<Lanes>(count, [&](std::size_t i, int n) {
        const Place<Lanes> at = locate_theta(table, read<Lanes>(theta_r + i, n));
        const RowPosition<Lanes> rows = locate_row(table, each ? read<Lanes>(strands + i, n) : Lanes(strands[0]));
        if (is_blended(table, rows)) {
            LobeValues<Lanes, 2 * K> values;
            join_rows(blended_rows(table, at, rows), values);
            return body(i, n, LaneMixture<Lanes, 2 * K, Family>(values, table.even));
        }
        const LobeValues<Lanes, K> values = values_at(table, at, rows);
        body(i, n, LaneMixture<Lanes, K, Family>(values, table.even));
    });
}

}  // namespace detail

// pdf of `count` directions in 1/sr, as a structure of arrays. `strands` is an array if `each`, else one number for all.
// Outputs must not overlap inputs.
template <class T, int K, class Family>
void pdf_batch(const LobeTable<T, K, const T *, Family> &table, std::size_t count, const T *theta_i, const T *theta_r,
               const T *phi, const T *strands, bool each, T *out) {
    if constexpr (CUTICLE_NATIVE_PACK && std::is_same_v<T, float>) {
        using Lanes = BatchLanes<T>;
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
template <class T, int K, class Family>
void sample_batch(const LobeTable<T, K, const T *, Family> &table, std::size_t count, const T *theta_r, const T *u_lobe,
                  const T *u_theta, const T *u_phi, const T *strands, bool each, T *theta_i, T *phi, T *density) {
    if constexpr (CUTICLE_NATIVE_PACK && std::is_same_v<T, float>) {
        using Lanes = BatchLanes<T>;
        detail::each_group(table, count, theta_r, strands, each, [&](std::size_t i, int n, const auto &mixture) {
            const auto get = [&](const T *from) { return detail::read<Lanes>(from + i, n); };
            const Sample<Lanes> s = mixture.sample(get(u_lobe), get(u_theta), get(u_phi));
            detail::write(s.theta_i, theta_i + i, n);
            detail::write(s.phi, phi + i, n);
            detail::write(s.pdf, density + i, n);
        });
    } else {
        for (std::size_t i = 0; i < count; ++i) {
            const Sample<T> s = sample(table, theta_r[i], u_lobe[i], u_theta[i], u_phi[i], each ? strands[i] : strands[0]);
            theta_i[i] = s.theta_i, phi[i] = s.phi, density[i] = s.pdf;
        }
    }
}

// The same at one shading point, for which `sampler` was prepared: nothing is looked up again.
template <class T, int K, class Family>
void pdf_batch(const PreparedSampler<T, K, Family> &sampler, std::size_t count, const T *theta_i, const T *phi, T *out) {
    if constexpr (CUTICLE_NATIVE_PACK && std::is_same_v<T, float>) {
        using Lanes = BatchLanes<T>;
        const detail::LanePoint<Lanes, T, K, Family> point(sampler);
        detail::groups<Lanes>(count, [&](std::size_t i, int n) {
            const auto get = [&](const T *from) { return detail::read<Lanes>(from + i, n); };
            detail::write(point.pdf(get(theta_i), get(phi)), out + i, n);
        });
    } else {
        for (std::size_t i = 0; i < count; ++i) out[i] = sampler.pdf(theta_i[i], phi[i]);
    }
}

template <class T, int K, class Family>
void sample_batch(const PreparedSampler<T, K, Family> &sampler, std::size_t count, const T *u_lobe, const T *u_theta,
                  const T *u_phi, T *theta_i, T *phi, T *density) {
    if constexpr (CUTICLE_NATIVE_PACK && std::is_same_v<T, float>) {
        using Lanes = BatchLanes<T>;
        const detail::LanePoint<Lanes, T, K, Family> point(sampler);
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
