// A sampler's table of lobe parameters, interpolated at one theta_r and number of strands.
#ifndef CUTICLE_SAMPLER_LOBE_TABLE_H
#define CUTICLE_SAMPLER_LOBE_TABLE_H

#include "cuticle/sampler/lobes.h"
#include "cuticle/sampler/strand_counts.h"
#include "cuticle/simd/lanes.h"

namespace cuticle {

// A view that owns nothing. Nodes lie at theta_r = -pi/2 + i pi / (theta_nodes - 1), rows at increasing strand counts.
// Memory is a pointer, or whatever ArrayTraits::gather takes; `strands` is memory of the processor that runs the code.
// Means and sigmas are those of the family's densities.
template <class Scalar, int K, class Memory = const Scalar *, class Family = NormalLobes> struct LobeTable {
    Memory nodes;           // [rows][theta_nodes][lobe_parameters][K]
    Memory energy;          // [rows][theta_nodes]: ∫ f cos, what a row weighs against another
    const Scalar *strands;  // [rows]
    int rows, theta_nodes;
    bool even;
};

// Loads N consecutive values from `index` on, one a lane.
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

// Locates theta_r among equal cells from -pi/2 to pi/2.
template <class Float> CUTICLE_INLINE Place<Float> locate_cell(int cells, const Float &theta_r) {
    return locate_node(Float((theta_r * Float(1 / pi<double>) + Float(.5)) * Float(cells)), cells + 1);
}

template <class Float, class Scalar, int K, class Memory, class Family>
CUTICLE_INLINE Place<Float> locate_theta(const LobeTable<Scalar, K, Memory, Family> &table, const Float &theta_r) {
    return locate_cell(table.theta_nodes - 1, theta_r);
}

// A number of strands located among the rows. Between 0 strands and the first positive count, the scattering function
// blends two different shapes, so the sampler mixes the densities of both rows in proportion to their energies. Beyond, it
// interpolates the rows' parameters. Count is a scalar where one number serves all lanes.
template <class Count> struct RowPosition {
    typename ArrayTraits<Count>::Index row;
    Count s;                              // fraction towards row + 1
    decltype(Count(0) < Count(0)) blend;  // between no strands and the first count
};

// The fraction from one count towards the next.
template <class Mask, class Count>
CUTICLE_INLINE Count count_fraction(const Mask &blend, const Count &low, const Count &high, const Count &strands) {
    const Count span = select(blend, math::min(high, Count(1)), Count(high - low));
    return math::clamp(Count((strands - low) / span), Count(0), Count(1));
}

template <class Count, class Scalar, int K, class Memory, class Family>
CUTICLE_INLINE RowPosition<Count> locate_row(const LobeTable<Scalar, K, Memory, Family> &table, const Count &strands) {
    const bool several = table.rows > 1, from_none = several && table.strands[0] == Scalar(0);
    const CountInterval<Count> count = locate_count(table.strands, table.rows, strands);
    const auto blend = strands < (from_none ? Count(table.strands[1]) : Count(0));
    // Most numbers equal a row's count: a branch spares them the division, for which all loads would wait.
    Count s = Count(0);
    if (several && any_above(strands, count.low)) s = count_fraction(blend, count.low, count.high, strands);
    return {count.row, s, blend};
}

// Whether any lane lies between no strands and the first count.
template <class Count, class Scalar, int K, class Memory, class Family>
CUTICLE_INLINE bool is_blended(const LobeTable<Scalar, K, Memory, Family> &table, const RowPosition<Count> &rows) {
    using Traits = ArrayTraits<Count>;
    const bool between = table.rows > 1 && Traits::any(rows.s > Count(0)) && Traits::any(rows.s < Count(1)) &&
                         table.strands[0] == Scalar(0) && Traits::any(rows.blend);
    if constexpr (std::is_arithmetic_v<Count>) return between;
    else return between && Traits::any(select(rows.blend, Count(rows.s * (Count(1) - rows.s)), Count(0)) > Count(0));
}

// The parameters of K lobes, in the table's order.
template <class Float, int K> struct LobeValues {
    Pack<Float, K> weight;
    Pack<Float, 2 * K> mean, sigma;

    CUTICLE_INLINE LobeValues mix(const Float &t, const LobeValues &to) const {
        const Pack<Float, 2 * K> t2(t);
        return {weight + Pack<Float, K>(t) * (to.weight - weight), mean + t2 * (to.mean - mean),
                sigma + t2 * (to.sigma - sigma)};
    }
};

namespace detail {
// The i-th parameter, in the table's order.
template <class Lanes, int K> CUTICLE_INLINE Lanes &parameter(LobeValues<Lanes, K> &values, int i) {
    return i < K ? values.weight.v[i] : i < 3 * K ? values.mean.v[i - K] : values.sigma.v[i - 3 * K];
}
}  // namespace detail

// interpolate_theta by whole loads in place of gathers, where lanes read one array of floats; returns false elsewhere.
template <class Float, class Index, int K, class Memory>
CUTICLE_INLINE bool interpolate_lanes(const Memory &, const Index &, const Float &, LobeValues<Float, K> &) {
    return false;
}
template <int W, int B, int K>
CUTICLE_INLINE bool interpolate_lanes(const float *const &data, const PackIndex<W> &first, const Pack<float, W, B> &t,
                                      LobeValues<Pack<float, W, B>, K> &out) {
#if CUTICLE_NATIVE_SHUFFLE
    if constexpr ((W == 4 || W == 8 || W == 16) && Pack<float, W, B>::chunks == 1) {
        constexpr std::make_integer_sequence<int, W> all;
        constexpr int size = lobe_parameters * K, fours = (size + 3) / 4;
        const auto start = [](int q) { return 4 * q < size - 4 ? 4 * q : size - 4; };  // the last may overlap the one before
        const auto &s = t.v[0];
        const detail::Quads<W> share[4] = {detail::pick<0, 0, 0, 0>(s, s, all), detail::pick<1, 1, 1, 1>(s, s, all),
                                           detail::pick<2, 2, 2, 2>(s, s, all), detail::pick<3, 3, 3, 3>(s, s, all)};
        detail::Quads<W> r[fours][4], turned[4];
#pragma GCC unroll 4
        for (int k = 0; k < 4; ++k)  // a lane's parameters are contiguous
#pragma GCC unroll 8
            for (int q = 0; q < fours; ++q) {
                const auto a = detail::read_quads<W>(data + start(q), first.v + k);
                r[q][k] = a + share[k] * (detail::read_quads<W>(data + size + start(q), first.v + k) - a);
            }
        for (int q = 0; q < fours; ++q) {
            detail::turn_over<W>(r[q], turned);
            for (int j = 0; j < 4; ++j) detail::parameter(out, start(q) + j).v[0] = turned[j];
        }
        return true;
    }
#endif
    static_cast<void>(data), static_cast<void>(first), static_cast<void>(t), static_cast<void>(out);
    return false;
}

template <class Float, class Scalar, int K, class Memory, class Family>
CUTICLE_INLINE LobeValues<Float, K> interpolate_theta(const LobeTable<Scalar, K, Memory, Family> &table,
                                                      const typename ArrayTraits<Float>::Index &row,
                                                      const Place<Float> &at) {
    using Index = typename ArrayTraits<Float>::Index;
    static_assert(lobe_weight == 0 && lobe_mean_theta == 1 && lobe_mean_phi == 2 && lobe_sigma_theta == 3);
    constexpr int size = lobe_parameters * K;
    const auto node = [&](const Index &i) {
        return LobeValues<Float, K>{load<Float, K>(table.nodes, i),
                                    load<Float, 2 * K>(table.nodes, Index(i + Index(lobe_mean_theta * K))),
                                    load<Float, 2 * K>(table.nodes, Index(i + Index(lobe_sigma_theta * K)))};
    };
    const Index first = (row * Index(table.theta_nodes) + at.node) * Index(size);
    LobeValues<Float, K> out;  // returned on all paths, here and below, so that nothing is copied
    if (interpolate_lanes(table.nodes, first, at.t, out)) return out;
    out = node(first).mix(at.t, node(Index(first + Index(size))));
    return out;
}

// The lobes' parameters where no densities are mixed. On a row, the usual case, nothing else is read.
template <class Float, class Count, class Scalar, int K, class Memory, class Family>
CUTICLE_INLINE LobeValues<Float, K> values_at(const LobeTable<Scalar, K, Memory, Family> &table, const Place<Float> &at,
                                              const RowPosition<Count> &rows) {
    using Traits = ArrayTraits<Count>;
    using Index = typename ArrayTraits<Float>::Index;
    using Row = typename Traits::Index;
    const bool on_lower = !any_above(rows.s, Count(0)), on_upper = !any_above(Count(-rows.s), Count(-1));
    const Row next = rows.row + Row(1);
    LobeValues<Float, K> values = interpolate_theta(table, Index(on_upper ? next : rows.row), at);
    if (!(table.rows == 1 || on_lower || on_upper))
        values = values.mix(Float(rows.s), interpolate_theta(table, Index(next), at));
    return values;
}

}  // namespace cuticle

#endif  // CUTICLE_SAMPLER_LOBE_TABLE_H
