// The sampler: lobes whose parameters run through a small table, linear in theta_r and in the number of strands,
// so that neither the density nor a sample has a seam.
#pragma once

#include "cuticle/lobes.h"

namespace cuticle {

// Hooks that an array type overloads: a gather, a conversion to an index, "does any lane need this?".
template <class Float, int N, class Scalar> CUTICLE_HD Pack<Float, N> load(const Scalar *data) {
    if constexpr (std::is_same_v<Float, Scalar>) {
        return load_pack<Float, N>(data);
    } else {
        Float values[N];
        for (int k = 0; k < N; ++k) values[k] = Float(data[k]);
        return load_pack<Float, N>(values);
    }
}
template <class Float> CUTICLE_HD int to_index(const Float &x) { return static_cast<int>(x); }
CUTICLE_HD inline bool any_of(bool mask) { return mask; }

// A view, owning nothing: nodes at theta_r = -pi/2 + i pi / (theta_nodes - 1), rows at increasing strand counts.
template <class Scalar, int K> struct LobeTable {
    const Scalar *nodes;    // [rows][theta_nodes][lobe_parameters][K]
    const Scalar *energy;   // [rows][theta_nodes]: ∫ f cos, what a row weighs against another
    const Scalar *strands;  // [rows]
    int rows, theta_nodes;
    bool even;
};

// Where theta_r and the number of strands fall. From 0 strands to the first positive count the scattering
// function is a blend of two different shapes, so there the sampler mixes the two rows' densities in proportion
// to their energies; further on the rows' parameters are interpolated.
template <class Float> struct TablePosition {
    int node, row;
    Float t, s;  // fractions towards node + 1 and row + 1
    bool blend;  // row 0 is for no strands, row 1 for some
};

template <class Float, class Scalar, int K>
CUTICLE_HD TablePosition<Float> locate(const LobeTable<Scalar, K> &table, const Float &theta_r, const Float &strands) {
    const Float last = Float(table.theta_nodes - 1);
    const Float x = math::clamp(Float((theta_r * Float(1 / pi<double>) + Float(.5)) * last), Float(0), last);
    const int node = math::min(to_index(x), table.theta_nodes - 2);
    int row = 0;
    while (row + 2 < table.rows && strands >= Float(table.strands[row + 1])) ++row;
    const Float lo = Float(table.strands[row]);
    const Float hi = table.rows > 1 ? Float(table.strands[row + 1]) : Float(lo + Float(1));
    const bool blend = table.rows > 1 && row == 0 && table.strands[0] == Scalar(0);
    const Float span = blend ? math::min(hi, Float(1)) : Float(hi - lo);
    // Branches, not a division on the way to every load: counts are whole more often than not.
    Float s = Float(0);
    if (table.rows > 1 && strands > lo) s = strands < lo + span ? Float((strands - lo) / span) : Float(1);
    return {node, row, Float(x - Float(node)), s, blend};
}

// The mixture for one theta_r and number of strands. Prepare once a shading point, then evaluate and draw.
template <class Float, int K> struct PreparedSampler {
    Lobes<Float, K> first, second;
    Float share;  // of `first`; 1 nearly always

    CUTICLE_HD Float pdf(const Float &theta_i, const Float &phi) const {
        const Float p = first.pdf(theta_i, phi);
        if (!any_of(share < Float(1))) return p;
        return share * p + (Float(1) - share) * second.pdf(theta_i, phi);
    }

    CUTICLE_HD Sample<Float> sample(const Float &u_lobe, const Float &u_theta, const Float &u_phi) const {
        if (!any_of(share < Float(1))) return first.sample(u_lobe, u_theta, u_phi);
        const bool in_first = u_lobe < share;
        const Float rest = math::max(Float(Float(1) - share), std::numeric_limits<Float>::min());
        Sample<Float> s =
            in_first ? first.sample(u_lobe / share, u_theta, u_phi) : second.sample((u_lobe - share) / rest, u_theta, u_phi);
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

template <class Float, class Scalar, int K>
CUTICLE_INLINE LobeValues<Float, K> interpolate_theta(const LobeTable<Scalar, K> &table, int row,
                                                      const TablePosition<Float> &at) {
    static_assert(lobe_weight == 0 && lobe_mean_theta == 1 && lobe_mean_phi == 2 && lobe_sigma_theta == 3);
    const auto node = [](const Scalar *p) {
        return LobeValues<Float, K>{load<Float, K>(p), load<Float, 2 * K>(p + lobe_mean_theta * K),
                                    load<Float, 2 * K>(p + lobe_sigma_theta * K)};
    };
    constexpr int size = lobe_parameters * K;
    const Scalar *p = table.nodes + (row * table.theta_nodes + at.node) * size;
    return node(p).mix(at.t, node(p + size));
}

template <class Float, class Scalar, int K>
CUTICLE_HD PreparedSampler<Float, K> prepare(const LobeTable<Scalar, K> &table, const Float &theta_r, const Float &strands) {
    const TablePosition<Float> at = locate<Float>(table, theta_r, strands);
    PreparedSampler<Float, K> out;
    out.share = Float(1);
    const auto set = [&](Lobes<Float, K> &to, const LobeValues<Float, K> &from) {
        to.set(from.weight, from.mean, from.sigma, table.even);
    };
    // On a row, the usual case, nothing else is touched: the parameters never leave the registers.
    const bool on_lower = !any_of(at.s > Float(0)), on_upper = !any_of(at.s < Float(1));
    if (on_lower || on_upper) {
        set(out.first, interpolate_theta(table, on_lower ? at.row : at.row + 1, at));
        return out;
    }
    const LobeValues<Float, K> lower = interpolate_theta(table, at.row, at);
    const LobeValues<Float, K> upper = interpolate_theta(table, at.row + 1, at);
    if (at.blend) {
        const Scalar *e = table.energy + at.node;
        const Scalar *g = e + table.theta_nodes;
        const Float e0 = (Float(1) - at.s) * (Float(e[0]) + at.t * Float(e[1] - e[0]));
        const Float e1 = at.s * (Float(g[0]) + at.t * Float(g[1] - g[0]));
        out.share = e0 / (e0 + e1);
        set(out.first, lower);
        set(out.second, upper);
    } else {
        set(out.first, lower.mix(at.s, upper));
    }
    return out;
}

}  // namespace cuticle
