// The sampler: lobes whose parameters run through a small table, linear in theta_r and in the number of strands,
// so that neither the density nor a sample has a seam.
#ifndef CUTICLE_SAMPLER_SAMPLER_H
#define CUTICLE_SAMPLER_SAMPLER_H

#include "cuticle/sampler/lobes.h"

namespace cuticle {

// A view, owning nothing: nodes at theta_r = -pi/2 + i pi / (theta_nodes - 1), rows at increasing strand counts.
// Memory is a pointer, or whatever ArrayTraits::gather takes; the strand counts lie where the code runs.
template <class Scalar, int K, class Memory = const Scalar *> struct LobeTable {
    Memory nodes;           // [rows][theta_nodes][lobe_parameters][K]
    Memory energy;          // [rows][theta_nodes]: ∫ f cos, what a row weighs against another
    const Scalar *strands;  // [rows]
    int rows, theta_nodes;
    bool even;
};

// N values from `index` on, a lane each.
template <class Float, int N, class Memory, class Index>
CUTICLE_INLINE Pack<Float, N> load(const Memory &memory, const Index &index) {
    if constexpr (std::is_same_v<Memory, const Float *>) {
        return load_pack<Float, N>(memory + index);
    } else {
        Pack<Float, N> r;
        for (int k = 0; k < N; ++k) r.set(k, ArrayTraits<Float>::gather(memory, Index(index + Index(k))));
        return r;
    }
}

// The two counts between which a number of strands falls, out of increasing ones; the first or the last two beyond.
template <class Float> struct CountInterval {
    typename ArrayTraits<Float>::Index row;
    Float low, high;
};

template <class Float, class Scalar>
CUTICLE_INLINE CountInterval<Float> locate_count(const Scalar *counts, int rows, const Float &strands) {
    using Traits = ArrayTraits<Float>;
    using Index = typename Traits::Index;
    const bool several = rows > 1;
    Index row = Index(0);
    Float low = Float(counts[0]), high = several ? Float(counts[1]) : Float(low + Float(1));
    if constexpr (std::is_arithmetic_v<Float>) {  // by branches, which do not hold up the loads
        while (row + 2 < rows && strands >= Float(counts[row + 1])) ++row;
        low = Float(counts[row]);
        if (several) high = Float(counts[row + 1]);
    } else {
        for (int k = 1; k + 1 < rows; ++k) {
            const Float count = Float(counts[k]);
            const auto past = strands >= count;
            if (!Traits::any(past)) break;
            row = select(past, Index(k), row);
            low = select(past, count, low);
            high = select(past, Float(counts[k + 1]), high);
        }
    }
    return {row, low, high};
}

// Where theta_r falls.
template <class Float> struct ThetaPosition {
    typename ArrayTraits<Float>::Index node;
    Float t;  // fraction towards node + 1
};

// Among equal cells from -pi/2 to pi/2.
template <class Float> CUTICLE_INLINE ThetaPosition<Float> locate_cell(int cells, const Float &theta_r) {
    using Index = typename ArrayTraits<Float>::Index;
    const Float last = Float(cells);
    // Just below the last node, so that there is one after it. In this order what is no number reads the first node, and
    // stays none by its fraction.
    const Float x = math::min(math::max(Float(0), Float((theta_r * Float(1 / pi<double>) + Float(.5)) * last)),
                              Float(last * Float(1 - epsilon<Float>)));
    const Index node = ArrayTraits<Float>::to_index(x);
    return {node, Float((x - Float(node)) + Float(0) * theta_r)};
}
template <class Float, class Scalar, int K, class Memory>
CUTICLE_INLINE ThetaPosition<Float> locate_theta(const LobeTable<Scalar, K, Memory> &table, const Float &theta_r) {
    return locate_cell(table.theta_nodes - 1, theta_r);
}

// Where the number of strands falls. From 0 strands to the first positive count the scattering function is a blend of two
// different shapes, so there the sampler mixes the two rows' densities in proportion to their energies; further on the
// rows' parameters are interpolated. One number for all lanes is a scalar.
template <class Count> struct RowPosition {
    typename ArrayTraits<Count>::Index row;
    Count s;                              // fraction towards row + 1
    decltype(Count(0) < Count(0)) blend;  // row 0 is for no strands, row 1 for some
};

template <class Count, class Scalar, int K, class Memory>
CUTICLE_INLINE RowPosition<Count> locate_row(const LobeTable<Scalar, K, Memory> &table, const Count &strands) {
    const bool several = table.rows > 1, from_none = several && table.strands[0] == Scalar(0);
    const CountInterval<Count> count = locate_count(table.strands, table.rows, strands);
    const Count lo = count.low, hi = count.high;
    const auto blend = strands < (from_none ? Count(table.strands[1]) : Count(0));
    // A branch, not a division on the way to every load: counts are whole more often than not.
    Count s = Count(0);
    if (several && ArrayTraits<Count>::any(strands > lo)) {
        const Count span = select(blend, math::min(hi, Count(1)), Count(hi - lo));
        s = math::clamp(Count((strands - lo) / span), Count(0), Count(1));
    }
    return {count.row, s, blend};
}

// The mixture for one theta_r and number of strands. Prepare once a shading point, then evaluate and draw.
template <class Float, int K> struct PreparedSampler {
    Lobes<Float, K> first, second;
    Float share,
        rest;      // of `first`, 1 nearly always, and of `second`: a difference from 1 would lose the digits of a small one
    bool blended;  // whether `second` is other than `first`

    CUTICLE_INLINE Float pdf(const Float &theta_i, const Float &phi) const {
        const Float p = first.pdf(theta_i, phi);
        if (!blended) return p;
        return share * p + rest * second.pdf(theta_i, phi);
    }

    CUTICLE_INLINE Sample<Float> sample(const Float &u_lobe, const Float &u_theta, const Float &u_phi) const {
        if (!blended) return first.sample(u_lobe, u_theta, u_phi);
        const auto in_first = u_lobe < share;
        // Below 1, whatever share and rest were rounded to: at 1 a lobe of weight 0 would be chosen.
        const Float beyond =
            math::min(Float((u_lobe - share) / math::max(rest, Float(smallest<Float>))), Float(1 - .5 * epsilon<Float>));
        const Float u = select(in_first, Float(u_lobe / share), beyond);
        const ChosenLobe<Float> a = first.choose(u), b = second.choose(u);
        const ChosenLobe<Float> chosen{select_normal(in_first, a.theta, b.theta), select_normal(in_first, a.phi, b.phi)};
        Sample<Float> s = draw(chosen, u_theta, u_phi, first.even);
        s.pdf = pdf(s.theta_i, s.phi);
        return s;
    }
};

// The parameters of K lobes, as they lie in the table.
template <class Float, int K> struct LobeValues {
    Pack<Float, K> weight;
    Pack<Float, 2 * K> mean, sigma;

    CUTICLE_INLINE LobeValues mix(const Float &t, const LobeValues &to) const {
        const Pack<Float, 2 * K> t2(t);
        return {weight + Pack<Float, K>(t) * (to.weight - weight), mean + t2 * (to.mean - mean),
                sigma + t2 * (to.sigma - sigma)};
    }
};

template <class Float, class Scalar, int K, class Memory>
CUTICLE_INLINE LobeValues<Float, K> interpolate_theta(const LobeTable<Scalar, K, Memory> &table,
                                                      const typename ArrayTraits<Float>::Index &row,
                                                      const ThetaPosition<Float> &at) {
    using Index = typename ArrayTraits<Float>::Index;
    static_assert(lobe_weight == 0 && lobe_mean_theta == 1 && lobe_mean_phi == 2 && lobe_sigma_theta == 3);
    constexpr int size = lobe_parameters * K;
    const auto node = [&](const Index &i) {
        return LobeValues<Float, K>{load<Float, K>(table.nodes, i),
                                    load<Float, 2 * K>(table.nodes, Index(i + Index(lobe_mean_theta * K))),
                                    load<Float, 2 * K>(table.nodes, Index(i + Index(lobe_sigma_theta * K)))};
    };
    const Index first = (row * Index(table.theta_nodes) + at.node) * Index(size);
    LobeValues<Float, K> out;  // the one thing returned, here and below: lanes' values are too many to be copied
    if constexpr (is_pack<Float> && std::is_same_v<Memory, const scalar_t<Float> *>)
        if (interpolate_lanes(table.nodes, first, at.t, out)) return out;
    out = node(first).mix(at.t, node(Index(first + Index(size))));
    return out;
}

// The lobes' parameters where no two rows' densities are mixed: on a row, the usual case, nothing else is touched.
template <class Float, class Count, class Scalar, int K, class Memory>
CUTICLE_INLINE LobeValues<Float, K> values_at(const LobeTable<Scalar, K, Memory> &table, const ThetaPosition<Float> &at,
                                              const RowPosition<Count> &rows) {
    using Traits = ArrayTraits<Count>;
    using Index = typename ArrayTraits<Float>::Index;
    using Row = typename Traits::Index;
    const bool on_lower = !Traits::any(rows.s > Count(0)), on_upper = !Traits::any(rows.s < Count(1));
    const Row next = rows.row + Row(1);
    LobeValues<Float, K> values = interpolate_theta(table, Index(on_upper ? next : rows.row), at);
    if (!(table.rows == 1 || on_lower || on_upper))
        values = values.mix(Float(rows.s), interpolate_theta(table, Index(next), at));
    return values;
}

template <class Float, class Count, class Scalar, int K, class Memory>
CUTICLE_INLINE Lobes<Float, K> lobes_at(const LobeTable<Scalar, K, Memory> &table, const ThetaPosition<Float> &at,
                                        const RowPosition<Count> &rows) {
    const LobeValues<Float, K> values = values_at(table, at, rows);
    Lobes<Float, K> lobes;
    lobes.set(values.weight, values.mean, values.sigma, table.even);
    return lobes;
}

// Whether any lane lies between no strands and the first count.
template <class Count, class Scalar, int K, class Memory>
CUTICLE_INLINE bool is_blended(const LobeTable<Scalar, K, Memory> &table, const RowPosition<Count> &rows) {
    using Traits = ArrayTraits<Count>;
    const bool between = table.rows > 1 && Traits::any(rows.s > Count(0)) && Traits::any(rows.s < Count(1)) &&
                         table.strands[0] == Scalar(0) && Traits::any(rows.blend);
    if constexpr (std::is_arithmetic_v<Count>) return between;
    else return between && Traits::any(select(rows.blend, Count(rows.s * (Count(1) - rows.s)), Count(0)) > Count(0));
}

template <class Float, class Scalar, int K, class Memory>
CUTICLE_HD PreparedSampler<Float, K> prepare_blended(const LobeTable<Scalar, K, Memory> &table,
                                                     const ThetaPosition<Float> &at, const RowPosition<Float> &rows) {
    using Traits = ArrayTraits<Float>;
    using Index = typename Traits::Index;
    const LobeValues<Float, K> lower = interpolate_theta(table, rows.row, at);
    const LobeValues<Float, K> upper = interpolate_theta(table, Index(rows.row + Index(1)), at);
    const Index e = rows.row * Index(table.theta_nodes) + at.node, g = e + Index(table.theta_nodes);
    const auto energy = [&](const Index &i) {
        const Float a = Traits::gather(table.energy, i), b = Traits::gather(table.energy, Index(i + Index(1)));
        return Float(a + at.t * (b - a));
    };
    const Float e0 = (Float(1) - rows.s) * energy(e), e1 = rows.s * energy(g);
    const LobeValues<Float, K> first = lower.mix(select(rows.blend, Float(0), rows.s), upper);
    PreparedSampler<Float, K> out;
    out.share = select(rows.blend, Float(e0 / (e0 + e1)), Float(1));
    out.rest = select(rows.blend, Float(e1 / (e0 + e1)), Float(0));
    out.blended = Traits::any(out.rest > Float(0));
    out.first.set(first.weight, first.mean, first.sigma, table.even);
    out.second.set(upper.weight, upper.mean, upper.sigma, table.even);
    return out;
}

template <class Float, class Scalar, int K, class Memory>
CUTICLE_INLINE PreparedSampler<Float, K> prepare(const LobeTable<Scalar, K, Memory> &table, const Float &theta_r,
                                                 const Float &strands) {
    const ThetaPosition<Float> at = locate_theta(table, theta_r);
    const RowPosition<Float> rows = locate_row(table, strands);
    if (is_blended(table, rows)) return prepare_blended(table, at, rows);
    PreparedSampler<Float, K> out;
    out.first = out.second = lobes_at(table, at, rows);
    out.share = Float(1);
    out.rest = Float(0);
    out.blended = false;
    return out;
}

// One direction a shading point, without anything passing through memory: pdf and sample of a prepared sampler.
template <class Float, class Scalar, int K, class Memory>
CUTICLE_INLINE Float pdf(const LobeTable<Scalar, K, Memory> &table, const Float &theta_i, const Float &theta_r,
                         const Float &phi, const Float &strands) {
    const ThetaPosition<Float> at = locate_theta(table, theta_r);
    const RowPosition<Float> rows = locate_row(table, strands);
    if (is_blended(table, rows)) return prepare_blended(table, at, rows).pdf(theta_i, phi);
    return lobes_at(table, at, rows).pdf(theta_i, phi);
}

template <class Float, class Scalar, int K, class Memory>
CUTICLE_INLINE Sample<Float> sample(const LobeTable<Scalar, K, Memory> &table, const Float &theta_r, const Float &u_lobe,
                                    const Float &u_theta, const Float &u_phi, const Float &strands) {
    const ThetaPosition<Float> at = locate_theta(table, theta_r);
    const RowPosition<Float> rows = locate_row(table, strands);
    if (is_blended(table, rows)) return prepare_blended(table, at, rows).sample(u_lobe, u_theta, u_phi);
    return lobes_at(table, at, rows).sample(u_lobe, u_theta, u_phi);
}

}  // namespace cuticle

#endif  // CUTICLE_SAMPLER_SAMPLER_H
