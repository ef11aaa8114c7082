// The sampler over arrays: directions side by side in the lanes of a vector, through the same lines as a single one.
// Fast where the compiler has vectors (GCC, Clang; float); elsewhere a plain loop.
#ifndef CUTICLE_BATCH_H
#define CUTICLE_BATCH_H

#include "cuticle/lanes.h"

namespace cuticle {

namespace detail {

// One lobe, each of its numbers in every lane: lobe by lobe all stays in registers.
template <class Lanes> struct LaneLobe {
    Lanes weight, scale;
    CentralNormal<Lanes> theta, phi;

    LaneLobe() = default;
    template <int K>
    CUTICLE_INLINE LaneLobe(const LobeValues<Lanes, K> &values, int k, bool even) : weight(values.weight[k]) {
        const Lanes pole(half_pi<double>), turn(pi<double>), mean = values.mean[K + k];
        theta = central_normal(values.mean[k], values.sigma[k], Lanes(-pole), pole);
        phi = central_normal(mean, values.sigma[K + k], even ? Lanes(0) : Lanes(mean - turn),
                             even ? turn : Lanes(mean + turn));
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

// The lobes of a mixture, made one by one as they are asked for.
template <class Lanes, int K> struct LaneMixture {
    static constexpr int count = K;
    const LobeValues<Lanes, K> &values;
    bool even;

    CUTICLE_INLINE LaneLobe<Lanes> lobe(int k) const { return {values, k, even}; }
    CUTICLE_INLINE Lanes weight(int k) const { return values.weight[k]; }
    // Its mean and sigma alone wait for the choice.
    template <class Choice> CUTICLE_INLINE ChosenLobe<Lanes> choose(const Choice &past) const {
        LobeValues<Lanes, 1> chosen;
        chosen.weight.set(0, values.weight[0]);
        for (int i = 0; i < 2; ++i) {
            chosen.mean.set(i, values.mean[i * K]);
            chosen.sigma.set(i, values.sigma[i * K]);
        }
        for (int k = 1; k < K; ++k) {
            const auto mask = past(k);
            for (int i = 0; i < 2; ++i) {
                chosen.mean.set(i, select(mask, values.mean[i * K + k], chosen.mean[i]));
                chosen.sigma.set(i, select(mask, values.sigma[i * K + k], chosen.sigma[i]));
            }
        }
        const LaneLobe<Lanes> lobe(chosen, 0, even);
        return {lobe.theta, lobe.phi};
    }
};

// The lobes of one shading point; a blend of two mixtures is one mixture of all their lobes.
template <class Lanes, class T, int K> struct LanePoint {
    LaneLobe<Lanes> lobes[2 * K];
    int count;
    bool even;

    CUTICLE_INLINE explicit LanePoint(const PreparedSampler<T, K> &sampler)
        : count(sampler.blended ? 2 * K : K), even(sampler.first.even) {
        for (int k = 0; k < K; ++k) {
            set(lobes[k], sampler.first, k, sampler.share);
            if (sampler.blended) set(lobes[K + k], sampler.second, k, T(1) - sampler.share);
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

// In d theta_i d phi, at an azimuth within half a turn of 0.
template <class Mixture, class Lanes>
CUTICLE_INLINE Lanes density(const Mixture &mixture, const Lanes &theta_i, const Lanes &wrapped) {
    const Lanes place = mixture.even ? math::abs(wrapped) : wrapped;
    Lanes total = Lanes(0);
    for (int k = 0; k < mixture.count; ++k) total = total + mixture.lobe(k).density(theta_i, place, mixture.even);
    return total;
}
template <class Mixture, class Lanes>
CUTICLE_INLINE Lanes lanes_pdf(const Mixture &mixture, const Lanes &theta_i, const Lanes &phi) {
    return per_steradian(density(mixture, theta_i, math::nearest_turn(phi)), theta_i);
}
template <class Mixture, class Lanes>
CUTICLE_INLINE Sample<Lanes> lanes_sample(const Mixture &mixture, const Lanes &u_lobe, const Lanes &u_theta,
                                          const Lanes &u_phi) {
    // Scaled by the sum that is reached in this very order, as in Lobes::choose: never into a lobe of weight 0.
    Lanes total = mixture.weight(0), below = Lanes(0);
    for (int k = 1; k < mixture.count; ++k) total = total + mixture.weight(k);
    const Lanes u = u_lobe * total;
    const auto past = [&](int k) {  // asked for k = 1, 2, ... once each
        below = k == 1 ? mixture.weight(0) : below + mixture.weight(k - 1);
        return u >= below;
    };
    Sample<Lanes> s = draw(mixture.choose(past), u_theta, u_phi, mixture.even);
    s.pdf = sample_per_steradian(density(mixture, s.theta_i, s.phi), s.theta_i);
    return s;
}

// The number of strands in each lane, or one for all.
template <class Lanes, class Count, class T, int K>
CUTICLE_INLINE Lanes lanes_pdf(const LobeTable<T, K> &table, const Lanes &theta_i, const Lanes &theta_r, const Lanes &phi,
                               const RowPosition<Count> &rows) {
    const LobeValues<Lanes, K> values = values_at(table, locate_theta(table, theta_r), rows);
    return lanes_pdf(LaneMixture<Lanes, K>{values, table.even}, theta_i, phi);
}
template <class Lanes, class Count, class T, int K>
CUTICLE_INLINE Sample<Lanes> lanes_sample(const LobeTable<T, K> &table, const Lanes &theta_r, const Lanes &u_lobe,
                                          const Lanes &u_theta, const Lanes &u_phi, const RowPosition<Count> &rows) {
    const LobeValues<Lanes, K> values = values_at(table, locate_theta(table, theta_r), rows);
    return lanes_sample(LaneMixture<Lanes, K>{values, table.even}, u_lobe, u_theta, u_phi);
}

}  // namespace detail

// pdf of `count` directions in 1/sr. Structure of arrays; `strands` is one number for all or, with `each`, an array.
template <class T, int K>
void pdf_batch(const LobeTable<T, K> &table, std::size_t count, const T *theta_i, const T *theta_r, const T *phi,
               const T *strands, bool each, T *out) {
    if constexpr (CUTICLE_NATIVE_PACK && std::is_same_v<T, float>) {
        using Lanes = BatchLanes<T>;
        const RowPosition<T> all = locate_row(table, each ? T(0) : strands[0]);
        const bool plain = !each && !is_blended(table, all);
        detail::groups<Lanes>(count, [&](std::size_t i, int n) {
            const auto get = [&](const T *from) { return detail::read<Lanes>(from + i, n); };
            const Lanes ti = get(theta_i), tr = get(theta_r), ph = get(phi);
            if (plain) return detail::write(detail::lanes_pdf(table, ti, tr, ph, all), out + i, n);
            const RowPosition<Lanes> rows = locate_row(table, each ? get(strands) : Lanes(strands[0]));
            if (is_blended(table, rows))
                detail::write(prepare_blended(table, locate_theta(table, tr), rows).pdf(ti, ph), out + i, n);
            else detail::write(detail::lanes_pdf(table, ti, tr, ph, rows), out + i, n);
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
        const RowPosition<T> all = locate_row(table, each ? T(0) : strands[0]);
        const bool plain = !each && !is_blended(table, all);
        detail::groups<Lanes>(count, [&](std::size_t i, int n) {
            const auto get = [&](const T *from) { return detail::read<Lanes>(from + i, n); };
            const auto put = [&](const Sample<Lanes> &s) {
                detail::write(s.theta_i, theta_i + i, n);
                detail::write(s.phi, phi + i, n);
                detail::write(s.pdf, density + i, n);
            };
            const Lanes tr = get(theta_r), u = get(u_lobe), v = get(u_theta), w = get(u_phi);
            if (plain) return put(detail::lanes_sample(table, tr, u, v, w, all));
            const RowPosition<Lanes> rows = locate_row(table, each ? get(strands) : Lanes(strands[0]));
            if (is_blended(table, rows)) put(prepare_blended(table, locate_theta(table, tr), rows).sample(u, v, w));
            else put(detail::lanes_sample(table, tr, u, v, w, rows));
        });
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
            detail::write(detail::lanes_pdf(point, get(theta_i), get(phi)), out + i, n);
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
            const Sample<Lanes> s = detail::lanes_sample(point, get(u_lobe), get(u_theta), get(u_phi));
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

#endif  // CUTICLE_BATCH_H
