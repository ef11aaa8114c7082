// The sampler over arrays: directions side by side in the lanes of a vector, through the same lines as a single one.
// Fast where the compiler has vectors (GCC, Clang; float); elsewhere a plain loop.
#ifndef CUTICLE_BATCH_H
#define CUTICLE_BATCH_H

#include "cuticle/lanes.h"

namespace cuticle {

// Lobe by lobe, so that a lobe's numbers stay in registers.
template <class Float, int K> CUTICLE_INLINE Lobes<Float, 1> lobe_of(const LobeValues<Float, K> &values, int k, bool even) {
    Lobes<Float, 1> lobe;
    Pack<Float, 2> mean, sigma;
    for (int i = 0; i < 2; ++i) {
        mean.set(i, values.mean[i * K + k]);
        sigma.set(i, values.sigma[i * K + k]);
    }
    lobe.set(Pack<Float, 1>(values.weight[k]), mean, sigma, even);
    return lobe;
}
template <class Float, int K>
CUTICLE_INLINE Float mixture_pdf(const LobeValues<Float, K> &values, bool even, const Float &theta_i, const Float &phi) {
    const Float wrapped = math::nearest_turn(phi);
    Float total = Float(0);
    for (int k = 0; k < K; ++k) total = total + lobe_of(values, k, even).density(theta_i, wrapped);
    return Lobes<Float, 1>::per_steradian(total, theta_i);
}

// The lobe that u chooses, alone.
template <class Float, int K>
CUTICLE_INLINE LobeValues<Float, 1> chosen_lobe(const LobeValues<Float, K> &values, const Float &u_lobe) {
    LobeValues<Float, 1> chosen;
    // Scaled by the sum that is reached in this very order, as in Lobes::choose: never into a lobe of weight 0.
    Float total = values.weight[0], below = total;
    for (int k = 1; k < K; ++k) total = total + values.weight[k];
    const Float u = u_lobe * total;
    chosen.weight.set(0, values.weight[0]);
    for (int i = 0; i < 2; ++i) {
        chosen.mean.set(i, values.mean[i * K]);
        chosen.sigma.set(i, values.sigma[i * K]);
    }
    for (int k = 1; k < K; ++k) {
        const auto past = u >= below;
        for (int i = 0; i < 2; ++i) {
            chosen.mean.set(i, select(past, values.mean[i * K + k], chosen.mean[i]));
            chosen.sigma.set(i, select(past, values.sigma[i * K + k], chosen.sigma[i]));
        }
        below = below + values.weight[k];
    }
    return chosen;
}

namespace detail {

template <class Float, int K>
CUTICLE_INLINE Float lanes_pdf(const LobeTable<scalar_t<Float>, K> &table, const Float &theta_i, const Float &theta_r,
                               const Float &phi, const Float &strands) {
    const TablePosition<Float> at = locate<Float>(table, theta_r, strands);
    if (is_blended(table, at)) return prepare_blended(table, at).pdf(theta_i, phi);
    return mixture_pdf(values_at(table, at), table.even, theta_i, phi);
}

template <class Float, int K>
CUTICLE_INLINE Sample<Float> lanes_sample(const LobeTable<scalar_t<Float>, K> &table, const Float &theta_r,
                                          const Float &u_lobe, const Float &u_theta, const Float &u_phi,
                                          const Float &strands) {
    const TablePosition<Float> at = locate<Float>(table, theta_r, strands);
    if (is_blended(table, at)) return prepare_blended(table, at).sample(u_lobe, u_theta, u_phi);
    const LobeValues<Float, K> values = values_at(table, at);
    const Lobes<Float, 1> lobe = lobe_of(chosen_lobe(values, u_lobe), 0, table.even);
    Sample<Float> s = lobe.draw({lobe.theta(0), lobe.phi(0)}, u_theta, u_phi);
    s.pdf = mixture_pdf(values, table.even, s.theta_i, s.phi);
    return s;
}

// The lobes of one shading point, each in every lane; a blend of two mixtures is one mixture of all their lobes.
template <class Lanes, class T, int K> struct LaneLobes {
    Lobes<Lanes, 1> lobe[2 * K];
    int count;

    CUTICLE_INLINE explicit LaneLobes(const PreparedSampler<T, K> &sampler) : count(sampler.blended ? 2 * K : K) {
        for (int k = 0; k < K; ++k) {
            set(lobe[k], sampler.first, k, sampler.share);
            if (sampler.blended) set(lobe[K + k], sampler.second, k, T(1) - sampler.share);
        }
    }
    CUTICLE_INLINE Lanes pdf(const Lanes &theta_i, const Lanes &phi) const {
        const Lanes wrapped = math::nearest_turn(phi);
        Lanes total = Lanes(T(0));
        for (int k = 0; k < count; ++k) total = total + lobe[k].density(theta_i, wrapped);
        return Lobes<Lanes, 1>::per_steradian(total, theta_i);
    }
    CUTICLE_INLINE Sample<Lanes> sample(const Lanes &u_lobe, const Lanes &u_theta, const Lanes &u_phi) const {
        Lanes total = lobe[0].weight[0], below = total;
        for (int k = 1; k < count; ++k) total = total + lobe[k].weight[0];
        const Lanes u = u_lobe * total;  // as in chosen_lobe
        ChosenLobe<Lanes> chosen{lobe[0].theta(0), lobe[0].phi(0)};
        for (int k = 1; k < count; ++k) {
            const auto past = u >= below;
            chosen = {select_normal(past, lobe[k].theta(0), chosen.theta), select_normal(past, lobe[k].phi(0), chosen.phi)};
            below = below + lobe[k].weight[0];
        }
        Sample<Lanes> s = lobe[0].draw(chosen, u_theta, u_phi);
        s.pdf = pdf(s.theta_i, s.phi);
        return s;
    }

  private:
    CUTICLE_INLINE static void set(Lobes<Lanes, 1> &to, const Lobes<T, K> &from, int k, const T &share) {
        const CentralNormal<T> theta = from.theta(k), phi = from.phi(k);
        const auto both = [](const T &a, const T &b) {
            Pack<Lanes, 2> r;
            r.set(0, Lanes(a));
            r.set(1, Lanes(b));
            return r;
        };
        to.weight.set(0, Lanes(from.weight[k] * share));
        to.scale.set(0, Lanes(from.scale[k] * share));
        to.normal = {both(theta.mean, phi.mean), both(theta.rate, phi.rate), both(theta.low, phi.low),
                     both(theta.mass, phi.mass), both(theta.under, phi.under)};
        to.even = from.even;
    }
};

}  // namespace detail

// pdf of `count` directions in 1/sr. Structure of arrays; `strands` is one number for all or, with `each`, an array.
template <class T, int K>
void pdf_batch(const LobeTable<T, K> &table, std::size_t count, const T *theta_i, const T *theta_r, const T *phi,
               const T *strands, bool each, T *out) {
    if constexpr (CUTICLE_NATIVE_PACK && std::is_same_v<T, float>) {
        using Lanes = BatchLanes<T>;
        detail::groups<Lanes>(count, [&](std::size_t i, int n) {
            const auto get = [&](const T *from) { return detail::read<Lanes>(from + i, n); };
            const Lanes s = each ? get(strands) : Lanes(strands[0]);
            detail::write(detail::lanes_pdf(table, get(theta_i), get(theta_r), get(phi), s), out + i, n);
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
        detail::groups<Lanes>(count, [&](std::size_t i, int n) {
            const auto get = [&](const T *from) { return detail::read<Lanes>(from + i, n); };
            const Lanes counts = each ? get(strands) : Lanes(strands[0]);
            const Sample<Lanes> s = detail::lanes_sample(table, get(theta_r), get(u_lobe), get(u_theta), get(u_phi), counts);
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

// The same for directions of one shading point, `sampler` prepared for it: nothing is looked up again.
template <class T, int K>
void pdf_batch(const PreparedSampler<T, K> &sampler, std::size_t count, const T *theta_i, const T *phi, T *out) {
    if constexpr (CUTICLE_NATIVE_PACK && std::is_same_v<T, float>) {
        using Lanes = BatchLanes<T>;
        const detail::LaneLobes<Lanes, T, K> lobes(sampler);
        detail::groups<Lanes>(count, [&](std::size_t i, int n) {
            detail::write(lobes.pdf(detail::read<Lanes>(theta_i + i, n), detail::read<Lanes>(phi + i, n)), out + i, n);
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
        const detail::LaneLobes<Lanes, T, K> lobes(sampler);
        detail::groups<Lanes>(count, [&](std::size_t i, int n) {
            const auto get = [&](const T *from) { return detail::read<Lanes>(from + i, n); };
            const Sample<Lanes> s = lobes.sample(get(u_lobe), get(u_theta), get(u_phi));
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
