// The sampler: lobes whose parameters are interpolated linearly in a small table, over theta_r and the number of strands,
// so that densities and samples are continuous.
#ifndef CUTICLE_SAMPLER_SAMPLER_H
#define CUTICLE_SAMPLER_SAMPLER_H

#include "cuticle/sampler/lobe_table.h"

namespace cuticle {

// The weights of two rows in the mixture, from their energies and the fraction s towards the second. Both are kept: 1 -
// first would lose the digits of a small second.
template <class Float> struct BlendShares {
    Float first, second;
};
template <class Float>
CUTICLE_INLINE BlendShares<Float> blend_shares(const Float &lower, const Float &upper, const Float &s) {
    const Float a = (Float(1) - s) * lower, b = s * upper;
    return {a / (a + b), b / (a + b)};
}

// u_lobe rescaled within the row that it selects. It stays below 1 however the shares were rounded: at 1 a lobe of weight 0
// would be chosen.
template <class Float> CUTICLE_INLINE Float within_row(const Float &u_lobe, const Float &share, const Float &rest) {
    const Float beyond =
        math::min(Float((u_lobe - share) / math::max(rest, Float(smallest<Float>))), Float(1 - .5 * epsilon<Float>));
    return select(u_lobe < share, Float(u_lobe / share), beyond);
}

// The mixture at one theta_r and number of strands. Prepare it once per shading point, then evaluate and sample.
template <class Float, int K, class Family = NormalLobes> struct PreparedSampler {
    Lobes<Float, K, Family> first, second;
    Float share, rest;  // weights of `first`, nearly always 1, and of `second`
    bool blended;       // whether `second` differs from `first`

    CUTICLE_INLINE Float pdf(const Float &theta_i, const Float &phi) const {
        const Float p = first.pdf(theta_i, phi);
        if (!blended) return p;
        return share * p + rest * second.pdf(theta_i, phi);
    }

    CUTICLE_INLINE Sample<Float> sample(const Float &u_lobe, const Float &u_theta, const Float &u_phi) const {
        if (!blended) return first.sample(u_lobe, u_theta, u_phi);
        const auto in_first = u_lobe < share;
        const Float u = within_row(u_lobe, share, rest);
        const ChosenLobe<Float, Family> a = first.choose(u), b = second.choose(u);
        const ChosenLobe<Float, Family> chosen{select_density<Family, Float>(in_first, a.theta, b.theta),
                                               select_density<Family, Float>(in_first, a.phi, b.phi)};
        Sample<Float> s = draw(chosen, u_theta, u_phi, first.even);
        s.pdf = pdf(s.theta_i, s.phi);
        return s;
    }
};

template <class Float, class Count, class Scalar, int K, class Memory, class Family>
CUTICLE_INLINE Lobes<Float, K, Family> lobes_at(const LobeTable<Scalar, K, Memory, Family> &table, const Place<Float> &at,
                                                const RowPosition<Count> &rows) {
    const LobeValues<Float, K> values = values_at(table, at, rows);
    Lobes<Float, K, Family> lobes;
    lobes.set(values.weight, values.mean, values.sigma, table.even);
    return lobes;
}

// The parameters of both rows whose densities are mixed, and what each weighs; lanes that blend nothing have `first` alone.
template <class Float, int K> struct BlendedRows {
    LobeValues<Float, K> first, second;
    Float share, rest;
};
template <class Float, class Scalar, int K, class Memory, class Family>
CUTICLE_INLINE BlendedRows<Float, K> blended_rows(const LobeTable<Scalar, K, Memory, Family> &table, const Place<Float> &at,
                                                  const RowPosition<Float> &rows) {
    using Traits = ArrayTraits<Float>;
    using Index = typename Traits::Index;
    const LobeValues<Float, K> lower = interpolate_theta(table, rows.row, at);
    BlendedRows<Float, K> out;
    out.second = interpolate_theta(table, Index(rows.row + Index(1)), at);
    const Index e = rows.row * Index(table.theta_nodes) + at.node, g = e + Index(table.theta_nodes);
    const auto energy = [&](const Index &i) {
        const Float a = Traits::gather(table.energy, i), b = Traits::gather(table.energy, Index(i + Index(1)));
        return math::linear(a, b, at.t);
    };
    const BlendShares<Float> shares = blend_shares(energy(e), energy(g), rows.s);
    out.first = lower.mix(select(rows.blend, Float(0), rows.s), out.second);
    out.share = select(rows.blend, shares.first, Float(1));
    out.rest = select(rows.blend, shares.second, Float(0));
    return out;
}

template <class Float, class Scalar, int K, class Memory, class Family>
CUTICLE_HD PreparedSampler<Float, K, Family> prepare_blended(const LobeTable<Scalar, K, Memory, Family> &table,
                                                             const Place<Float> &at, const RowPosition<Float> &rows) {
    const BlendedRows<Float, K> both = blended_rows(table, at, rows);
    PreparedSampler<Float, K, Family> out;
    out.share = both.share;
    out.rest = both.rest;
    out.blended = ArrayTraits<Float>::any(out.rest > Float(0));
    out.first.set(both.first.weight, both.first.mean, both.first.sigma, table.even);
    out.second.set(both.second.weight, both.second.mean, both.second.sigma, table.even);
    return out;
}

template <class Float, class Scalar, int K, class Memory, class Family>
CUTICLE_INLINE PreparedSampler<Float, K, Family> prepare(const LobeTable<Scalar, K, Memory, Family> &table,
                                                         const Float &theta_r, const Float &strands) {
    const Place<Float> at = locate_theta(table, theta_r);
    const RowPosition<Float> rows = locate_row(table, strands);
    if (is_blended(table, rows)) return prepare_blended(table, at, rows);
    PreparedSampler<Float, K, Family> out;
    out.first = out.second = lobes_at(table, at, rows);
    out.share = Float(1);
    out.rest = Float(0);
    out.blended = false;
    return out;
}

// pdf and sample of one direction per shading point: as of a prepared sampler, without a round trip through memory.
template <class Float, class Scalar, int K, class Memory, class Family>
CUTICLE_INLINE Float pdf(const LobeTable<Scalar, K, Memory, Family> &table, const Float &theta_i, const Float &theta_r,
                         const Float &phi, const Float &strands) {
    const Place<Float> at = locate_theta(table, theta_r);
    const RowPosition<Float> rows = locate_row(table, strands);
    if (is_blended(table, rows)) return prepare_blended(table, at, rows).pdf(theta_i, phi);
    return lobes_at(table, at, rows).pdf(theta_i, phi);
}

template <class Float, class Scalar, int K, class Memory, class Family>
CUTICLE_INLINE Sample<Float> sample(const LobeTable<Scalar, K, Memory, Family> &table, const Float &theta_r,
                                    const Float &u_lobe, const Float &u_theta, const Float &u_phi, const Float &strands) {
    const Place<Float> at = locate_theta(table, theta_r);
    const RowPosition<Float> rows = locate_row(table, strands);
    if (is_blended(table, rows)) return prepare_blended(table, at, rows).sample(u_lobe, u_theta, u_phi);
    return lobes_at(table, at, rows).sample(u_lobe, u_theta, u_phi);
}

}  // namespace cuticle

#endif  // CUTICLE_SAMPLER_SAMPLER_H
