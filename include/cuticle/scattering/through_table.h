// What comes to a strand through others, and from those behind it: tables of what transport operators over directions give
// (strand_transport.py), for strands in sheets, one after another, and for a number of them that is random.
//
// Four parts are told apart: R, TT and TRT of the strand itself, and what the strands behind it send back. Each is its
// energy, times a density of azimuth, times a mixture of three energy-conserving M's (longitudinal_mixtures.py): light that
// another strand passed on has a peak in theta_i for each of that strand's lobes.
#ifndef CUTICLE_SCATTERING_THROUGH_TABLE_H
#define CUTICLE_SCATTERING_THROUGH_TABLE_H

#include "cuticle/scattering/azimuthal.h"
#include "cuticle/scattering/longitudinal.h"

namespace cuticle {

inline constexpr int through_parts = lobe_count + 1;
inline constexpr int strand_nodes = 6;    // 0, 1, 2, 4, 8 and 16 strands
inline constexpr int energy_columns = 2;  // ln of the energy, its bend (through_energy)
inline constexpr int part_lobes = 3;      // M's of a part
inline constexpr int along_columns =
    3 * part_lobes - 1;  // shares of all M's but the last, then each one's axis and variance

// Nodes stand twice: for strands that are counted, in sheets, then for a Poisson number of them (`random`). Light that met
// counted strands met one at least; at their node of 0 the last part is what the strands behind send back of direct light.
template <class Scalar, class Memory = const Scalar *> struct ThroughTable {
    Memory energy;   // [random][node][row][column][part][channel], theta_r from -limit to limit
    Memory along;    // [random][node][along row][column][part][channel], the same theta_r
    Memory azimuth;  // [random][node][azimuth row][column][part][channel], the same theta_r; phi from 0 to pi
    Memory behind;   // [row][Behind][channel]
    int rows, along_rows, azimuth_rows, columns, channels;
    Scalar limit;
    int parts = through_parts;  // 1 where what memory holds at an index is all parts
};

// Among 0, 1, 2, 4, 8 and 16 strands: the node below, the fraction toward the next, and how far past the last.
template <class Float> struct StrandsPlace {
    typename ArrayTraits<Float>::Index node;
    Float t, past;
};
template <class Float> CUTICLE_INLINE StrandsPlace<Float> locate_strands(const Float &strands) {
    const auto one = strands < Float(1), two = strands < Float(2), four = strands < Float(4), eight = strands < Float(8);
    const Float low =
        select(one, Float(0),
               Float(select(two, Float(1), Float(select(four, Float(2), Float(select(eight, Float(4), Float(8))))))));
    const Float node =
        select(one, Float(0),
               Float(select(two, Float(1), Float(select(four, Float(2), Float(select(eight, Float(3), Float(4))))))));
    const Float t = (strands - low) / math::max(low, Float(1));
    return {ArrayTraits<Float>::to_index(node), math::clamp(t, Float(0), Float(1)),
            math::max(Float(t - Float(1)), Float(0))};
}

// Among inclinations from -limit to limit.
template <class Float> CUTICLE_INLINE Place<Float> locate_viewer(const Float &theta, int rows, const Float &limit) {
    return locate_node(Float((theta / limit + Float(1)) * Float(.5) * Float(rows - 1)), rows);
}

// A part's energy, from its logs at two numbers of strands and how far it lies above their mean halfway; past the last it
// falls as it does there.
template <class Value, class Float>
CUTICLE_INLINE Value through_energy(const Value &lower, const Value &upper, const Value &bend,
                                    const StrandsPlace<Float> &at) {
    const Float bow = Float(4) * at.t * (Float(1) - at.t);
    const Value slope = math::min(Value(upper - lower - Value(Float(4)) * bend), Value(0));
    return math::exp(Value(math::linear(lower, upper, at.t) + bend * bow + slope * at.past));
}

// Where a viewer and a number of strands fall in the tables.
template <class Float> struct ThroughPlace {
    StrandsPlace<Float> strands;
    Place<Float> row, along_row, azimuth_row;
    bool random;
    bool scattered;  // whether any light met other strands: else no part is looked up
};
template <class Float, class Scalar, class Memory>
CUTICLE_INLINE ThroughPlace<Float> locate(const ThroughTable<Scalar, Memory> &table, const Float &theta_r,
                                          const Float &strands, bool random, bool scattered) {
    const Float limit = Float(table.limit);
    return {locate_strands(strands),
            locate_viewer(theta_r, table.rows, limit),
            locate_viewer(theta_r, table.along_rows, limit),
            locate_viewer(theta_r, table.azimuth_rows, limit),
            random,
            scattered};
}

// A part's energy and, along theta_i, its M's and their shares.
template <class Value> struct ThroughPart {
    Value energy, share[part_lobes], axis[part_lobes], variance[part_lobes];
};
// Their mixture; times cos theta_i it integrates to 1 over theta_i.
template <class Value> CUTICLE_INLINE Value part_m(const ThroughPart<Value> &part, const Value &theta_i) {
    Value sum = Value(0);
    for (int k = 0; k < part_lobes; ++k)
        sum = sum + part.share[k] * energy_conserving_m(theta_i, part.axis[k], part.variance[k]);
    return sum;
}
// From the columns of `along`.
template <class Value> CUTICLE_INLINE ThroughPart<Value> part_of(const Value &energy, const Value columns[along_columns]) {
    ThroughPart<Value> part;
    part.energy = energy;
    part.share[part_lobes - 1] = Value(1);
    for (int k = 0; k < part_lobes - 1; ++k) {
        part.share[k] = columns[k];
        part.share[part_lobes - 1] = part.share[part_lobes - 1] - columns[k];
    }
    part.share[part_lobes - 1] = math::max(part.share[part_lobes - 1], Value(0));  // rounding
    for (int k = 0; k < part_lobes; ++k) {
        part.axis[k] = columns[part_lobes - 1 + 2 * k];
        part.variance[k] = columns[part_lobes + 2 * k];
    }
    return part;
}

// How a part of a strand differs from that of the others, for which tables were made: its energy is theirs times `energy`,
// and its own M lies `tilt` further, with `variance` in place of `others`, in theta.
template <class Value> struct OwnPart {
    Value energy, tilt, variance, others;
};
// Where its own M is the narrower, what is narrower than the others' is narrowed in proportion: the difference of variances
// might be more than it has.
template <class Value> CUTICLE_INLINE Value own_variance(const Value &variance, const OwnPart<Value> &own) {
    return math::max(Value(variance + (own.variance - own.others)),
                     Value(variance * math::min(Value(own.variance / own.others), Value(1))));
}
template <class Value>
CUTICLE_INLINE ThroughPart<Value> own_part(const ThroughPart<Value> &part, const OwnPart<Value> &own) {
    ThroughPart<Value> its = part;
    its.energy = part.energy * own.energy;
    for (int k = 0; k < part_lobes; ++k) {
        its.axis[k] = part.axis[k] + own.tilt;
        its.variance[k] = own_variance(part.variance[k], own);
    }
    return its;
}

// Where a part's values begin in a table, `size` values a node, for fewer and for more strands. Part through_parts is the
// backscatter of direct light, whatever the strands.
template <class Index> struct PartSlots {
    Index lower, upper;
};
template <class Float, class Scalar, class Memory>
CUTICLE_INLINE PartSlots<typename ArrayTraits<Float>::Index> part_slots(const ThroughTable<Scalar, Memory> &table,
                                                                        const ThroughPlace<Float> &at, int part, int size) {
    using Index = typename ArrayTraits<Float>::Index;
    const bool direct = part == through_parts;
    const int first = math::min(part, table.parts - 1) * table.channels, random = at.random ? strand_nodes * size : 0;
    const Index lower = direct ? Index(first) : Index(Index(first + random) + at.strands.node * Index(size));
    return {lower, direct ? lower : Index(lower + Index(size))};
}

template <class Value, class Float, class Scalar, class Memory, class Channel>
CUTICLE_INLINE ThroughPart<Value> through_part(const ThroughTable<Scalar, Memory> &table, const ThroughPlace<Float> &at,
                                               int part, const Channel &channel) {
    using Index = typename ArrayTraits<Float>::Index;
    const int one = table.parts * table.channels, size = energy_columns * one, lobes = along_columns * one;
    const PartSlots<Index> energy = part_slots(table, at, part, table.rows * size);
    const PartSlots<Index> along = part_slots(table, at, part, table.along_rows * lobes);
    Value columns[along_columns];
    for (int k = 0; k < along_columns; ++k)
        columns[k] =
            math::linear(between_rows<Value>(table.along, along.lower, at.along_row, lobes, k * one, channel),
                         between_rows<Value>(table.along, along.upper, at.along_row, lobes, k * one, channel), at.strands.t);
    const Value passed =
        through_energy(between_rows<Value>(table.energy, energy.lower, at.row, size, 0, channel),
                       between_rows<Value>(table.energy, energy.upper, at.row, size, 0, channel),
                       between_rows<Value>(table.energy, energy.lower, at.row, size, one, channel), at.strands);
    return part_of(passed, columns);
}

// What an end of the strands behind changes: the rates at which the backscatter of direct and of scattered light grows with
// them, and what comes through other strands where none stands behind, out of what does before a half space.
template <class Float> struct Behind {
    Float direct, scattered, alone;
};
template <class Value, class Float, class Memory, class Channel>
CUTICLE_HD Behind<Value> behind_at(const Memory &behind, const Place<Float> &row, int channels, const Channel &channel) {
    using Index = typename ArrayTraits<Float>::Index;
    const Index first = Index(0);
    const int size = 3 * channels;
    return {between_rows<Value>(behind, first, row, size, 0, channel),
            between_rows<Value>(behind, first, row, size, channels, channel),
            between_rows<Value>(behind, first, row, size, 2 * channels, channel)};
}

// The density of phi that a part is multiplied by; column: that of phi.
template <class Value, class Float, class Scalar, class Memory, class Channel>
CUTICLE_INLINE Value through_turn(const ThroughTable<Scalar, Memory> &table, const ThroughPlace<Float> &at,
                                  const Place<Float> &column, int part, const Channel &channel) {
    using Index = typename ArrayTraits<Float>::Index;
    const int size = table.parts * table.channels, row = table.columns * size;
    const PartSlots<Index> slots = part_slots(table, at, part, table.azimuth_rows * row);
    const Index within = at.azimuth_row.node * Index(row) + column.node * Index(size);
    return math::convex(
        bilinear_value<Value>(table.azimuth, Index(slots.lower + within), row, size, at.azimuth_row.t, column.t, channel),
        bilinear_value<Value>(table.azimuth, Index(slots.upper + within), row, size, at.azimuth_row.t, column.t, channel),
        at.strands.t);
}

}  // namespace cuticle

#endif  // CUTICLE_SCATTERING_THROUGH_TABLE_H
