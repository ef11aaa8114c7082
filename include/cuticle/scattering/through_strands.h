// What comes to a strand through others, and from those behind it, part by part: sums that are evaluated, and what they are
// drawn from. through_table.h says what the parts are.
#ifndef CUTICLE_SCATTERING_THROUGH_STRANDS_H
#define CUTICLE_SCATTERING_THROUGH_STRANDS_H

#include "cuticle/scattering/part_draw.h"
#include "cuticle/scattering/through_table.h"
#include "cuticle/simd/several.h"

namespace cuticle {

// Of R, TT and TRT.
template <class Float> struct OwnParts {
    OwnPart<Float> of[lobe_count];
};

// All parts, then direct light's backscatter.
template <class Float> struct ThroughMoments {
    using Lobes = Several<Float, part_lobes *(through_parts + 1)>;  // the M's of a part one after another
    Float energy[through_parts + 1];
    Lobes share{0}, axis{0}, variance{1};

    CUTICLE_INLINE void set(int p, const ThroughPart<Float> &part) {
        energy[p] = part.energy;
        for (int k = 0; k < part_lobes; ++k) {
            share.set(part_lobes * p + k, part.share[k]);
            axis.set(part_lobes * p + k, part.axis[k]);
            variance.set(part_lobes * p + k, part.variance[k]);
        }
    }
};
template <class Float, class Scalar, class Memory, class Channel>
CUTICLE_INLINE ThroughMoments<Float> through_moments(const ThroughTable<Scalar, Memory> &table,
                                                     const ThroughPlace<Float> &at, const Channel &channel,
                                                     const OwnParts<Float> *own = nullptr) {
    ThroughMoments<Float> moments;
    for (int p = 0; p <= through_parts; ++p) {
        moments.energy[p] = Float(0);
        if (!at.scattered && p < through_parts) continue;
        const ThroughPart<Float> others = through_part<Float>(table, at, p, channel);
        const bool its = own && p < lobe_count;  // the last two are the others'
        moments.set(p, its ? own_part(others, own->of[p]) : others);
    }
    return moments;
}

// Passes the M's of a part, by their shares in `share` times its energy.
template <class Float>
CUTICLE_INLINE ChosenPart<Float> pass_mixture(const ChosenPart<Float> &by, const Float &u, const Float &share,
                                              const ThroughMoments<Float> &parts, int p, int channel) {
    ChosenPart<Float> chosen = by;
    for (int i = part_lobes * p; i < part_lobes * (p + 1); ++i)
        chosen = pass_part(chosen, u, Float(share * parts.energy[p] * Float(parts.share[i])), p, channel,
                           Float(parts.axis[i]), Float(parts.variance[i]));
    return chosen;
}

// The parts' M times their energies: lobes[through_parts + 1].
template <class Float>
CUTICLE_INLINE void part_lobes_at(const ThroughMoments<Float> &parts, const Float &theta_i, Float *lobes) {
    using Lobes = typename ThroughMoments<Float>::Lobes;
    const Lobes m = parts.share * energy_conserving_m(Lobes(theta_i), parts.axis, parts.variance);
    for (int p = 0; p <= through_parts; ++p) {
        Float sum = m[part_lobes * p];
        for (int k = 1; k < part_lobes; ++k) sum = sum + m[part_lobes * p + k];
        lobes[p] = parts.energy[p] * sum;
    }
}

// The same over cos theta_i.
template <class Float>
CUTICLE_INLINE void through_lobes(const ThroughMoments<Float> &parts, const Float &theta_i, Float *lobes) {
    part_lobes_at(parts, theta_i, lobes);
    const Float secant = Float(1) / math::cos_theta(theta_i);
    for (int p = 0; p <= through_parts; ++p) lobes[p] = lobes[p] * secant;
}

// The densities of phi that the lobes are multiplied by: values[through_parts + 1].
template <class Float, class Scalar, class Memory, class Channel>
CUTICLE_INLINE void through_azimuths(const ThroughTable<Scalar, Memory> &table, const ThroughPlace<Float> &at,
                                     const Float &phi, const Channel &channel, Float *values) {
    const Place<Float> column = locate_azimuth(phi, table.columns);
    for (int p = 0; p <= through_parts; ++p)
        values[p] = at.scattered || p == through_parts ? through_turn<Float>(table, at, column, p, channel) : Float(0);
}

// What of that goes to an azimuth: the sum over parts of their lobes times their densities of phi.
template <class Float, class Scalar, class Memory, class Channel>
CUTICLE_HD Float add_through(Float sum, const ThroughTable<Scalar, Memory> &table, const ThroughPlace<Float> &at,
                             const Float *lobes, const Float &phi, const Channel &channel) {
    Float values[through_parts + 1];
    through_azimuths(table, at, phi, channel, values);
    for (int p = 0; p <= through_parts; ++p) sum = sum + lobes[p] * values[p];
    return sum;
}

// The densities of one part in one channel, as add_through has them.
template <class Float, class Memory> struct AzimuthNodes {
    Memory values;
    typename ArrayTraits<Float>::Index lower, upper;  // of fewer and of more strands
    int nodes, node, row;                             // how many; from one to the next
    Float between_rows, between_strands;
};
template <class Value, class Float, class Memory>
CUTICLE_INLINE Value node_value(const AzimuthNodes<Float, Memory> &of, int node) {
    using Index = typename ArrayTraits<Float>::Index;
    const Place<Float> row = {Index(0), of.between_rows};
    const int column = node * of.node;
    return math::convex(between_rows<Value>(of.values, of.lower, row, of.row, column, 0),
                        between_rows<Value>(of.values, of.upper, row, of.row, column, 0), of.between_strands);
}
template <class Float, class Memory> CUTICLE_INLINE int node_count(const AzimuthNodes<Float, Memory> &of) {
    return of.nodes;
}
template <class Float, class Memory> CUTICLE_INLINE Float node_density(const AzimuthNodes<Float, Memory> &of, int node) {
    return node_value<Float>(of, node);
}
// `part`: up to through_parts, which is direct light's backscatter.
template <class Float, class Scalar, class Memory>
CUTICLE_HD AzimuthNodes<Float, Memory> azimuth_nodes(const ThroughTable<Scalar, Memory> &table,
                                                     const ThroughPlace<Float> &at, const Float &part,
                                                     const Float &channel) {
    using Index = typename ArrayTraits<Float>::Index;
    const int size = table.parts * table.channels, row = table.columns * size, slot = table.azimuth_rows * row;
    const auto direct = part > Float(lobe_count);
    const Float own = math::min(part, Float(table.parts - 1)) * Float(table.channels) + channel;
    const Index first = at.azimuth_row.node * Index(row) + ArrayTraits<Float>::to_index(own);
    const Index scattered = first + (at.strands.node + Index(at.random ? strand_nodes : 0)) * Index(slot);
    return {table.azimuth,
            select(direct, first, scattered),
            select(direct, first, Index(scattered + Index(slot))),
            table.columns,
            size,
            row,
            at.azimuth_row.t,
            at.strands.t};
}

// What hair passes on of light that meets some of it: ln of its energy in all directions on, out of 1, for rows of
// inclination theta_i of the light.
template <class Scalar, class Memory = const Scalar *> struct TransmittanceTable {
    Memory logs;  // [random][0 (sheets: 1), 1, 2, 4, 8 and 16 strands][row][channel], theta_i from -limit to limit
    int rows, channels;
    Scalar limit;
};

// Of light that met a strand: `strands` in all where they are counted, or expected of a Poisson number of them.
template <class Float, class Scalar, class Memory, class Channel>
CUTICLE_HD Float transmittance(const TransmittanceTable<Scalar, Memory> &table, const Float &theta_i, const Float &strands,
                               bool random, const Channel &channel) {
    using Index = typename ArrayTraits<Float>::Index;
    const StrandsPlace<Float> at = locate_strands(strands);
    const Place<Float> row = locate_viewer(theta_i, table.rows, Float(table.limit));
    const int slot = table.rows * table.channels;
    const Index lower = (at.node + Index(random ? strand_nodes : 0)) * Index(slot), upper = lower + Index(slot);
    return through_energy(between_rows<Float>(table.logs, lower, row, table.channels, 0, channel),
                          between_rows<Float>(table.logs, upper, row, table.channels, 0, channel), Float(0), at);
}

}  // namespace cuticle

#endif  // CUTICLE_SCATTERING_THROUGH_STRANDS_H
