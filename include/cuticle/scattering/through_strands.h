// What comes to a strand through others, and from those behind it: tables of what transport operators over directions give
// (strand_transport.py), for strands in sheets, one after another, and for a number of them that is random.
//
// Four parts are told apart: R, TT and TRT of the strand itself, and what the strands behind it send back. Each is its
// energy, times a density of azimuth, times the energy-conserving M of the same mean and mean square of sin theta_i.
#ifndef CUTICLE_SCATTERING_THROUGH_STRANDS_H
#define CUTICLE_SCATTERING_THROUGH_STRANDS_H

#include "cuticle/scattering/azimuthal.h"
#include "cuticle/scattering/longitudinal.h"
#include "cuticle/scattering/part_draw.h"
#include "cuticle/simd/several.h"

namespace cuticle {

constexpr int through_parts = lobe_count + 1;
// First what the strands behind send back of direct light, then all parts for 0 (sheets: 1), 1, 2, 4, 8 and 16 strands.
constexpr int through_slots = 7;
constexpr int through_columns = 4;  // ln of the energy, its bend (through_energy), the M's axis and its variance

// Each table stands twice: for strands that are counted, in sheets, then for a Poisson number of them (`random`).
template <class Scalar, class Memory = const Scalar *> struct ThroughTable {
    Memory lobes;    // [random][slot][row][column][part][channel], theta_r from -limit to limit
    Memory azimuth;  // [random][slot][azimuth row][column][part][channel], the same theta_r; phi from 0 to pi
    Memory behind;   // [row][Behind][channel], once
    int rows, azimuth_rows, columns, channels;
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
    Place<Float> row, azimuth_row;
    bool random;
    bool scattered;  // whether any light met other strands: else no part is looked up
};
template <class Float, class Scalar, class Memory>
CUTICLE_INLINE ThroughPlace<Float> locate(const ThroughTable<Scalar, Memory> &table, const Float &theta_r,
                                          const Float &strands, bool random, bool scattered) {
    const Float limit = Float(table.limit);
    return {locate_strands(strands), locate_viewer(theta_r, table.rows, limit),
            locate_viewer(theta_r, table.azimuth_rows, limit), random, scattered};
}

// A part's energy and its M.
template <class Value> struct ThroughPart {
    Value energy, axis, variance;
};
template <class Value, class Float, class Scalar, class Memory, class Channel>
CUTICLE_INLINE ThroughPart<Value> through_part(const ThroughTable<Scalar, Memory> &table, const ThroughPlace<Float> &at,
                                               int part, const Channel &channel) {
    using Index = typename ArrayTraits<Float>::Index;
    const int column = table.parts * table.channels, size = through_columns * column, slot = table.rows * size;
    const int energy = part * table.channels, bend = energy + column, axis = bend + column, variance = axis + column;
    const Index lower = Index(at.random ? through_slots * slot : 0) + (at.strands.node + Index(1)) * Index(slot);
    const Index upper = lower + Index(slot);
    return {through_energy(between_rows<Value>(table.lobes, lower, at.row, size, energy, channel),
                           between_rows<Value>(table.lobes, upper, at.row, size, energy, channel),
                           between_rows<Value>(table.lobes, lower, at.row, size, bend, channel), at.strands),
            math::linear(between_rows<Value>(table.lobes, lower, at.row, size, axis, channel),
                         between_rows<Value>(table.lobes, upper, at.row, size, axis, channel), at.strands.t),
            math::linear(between_rows<Value>(table.lobes, lower, at.row, size, variance, channel),
                         between_rows<Value>(table.lobes, upper, at.row, size, variance, channel), at.strands.t)};
}
// What comes back of direct light: the last part.
template <class Value, class Float, class Scalar, class Memory, class Channel>
CUTICLE_INLINE ThroughPart<Value> direct_back(const ThroughTable<Scalar, Memory> &table, const ThroughPlace<Float> &at,
                                              const Channel &channel) {
    using Index = typename ArrayTraits<Float>::Index;
    const int column = table.parts * table.channels, size = through_columns * column, last = column - table.channels;
    const Index first = Index(at.random ? through_slots * table.rows * size : 0);
    return {math::exp(between_rows<Value>(table.lobes, first, at.row, size, last, channel)),
            between_rows<Value>(table.lobes, first, at.row, size, 2 * column + last, channel),
            between_rows<Value>(table.lobes, first, at.row, size, 3 * column + last, channel)};
}

// How a strand differs from the others, for which the tables were made: its parts' energies are those times `energy`, and
// its own M lies `tilt` further and is wider by `variance` (radians, theta).
template <class Float> struct OwnParts {
    Float energy[lobe_count], tilt[lobe_count], variance[lobe_count];
};
template <class Value>
CUTICLE_INLINE ThroughPart<Value> own_part(const ThroughPart<Value> &others, const Value &energy, const Value &tilt,
                                           const Value &variance) {
    return {others.energy * energy, others.axis + tilt,
            math::max(Value(others.variance + variance), Value(scalar_t<Value>(1e-4)))};
}

// The energies of all parts, then that of direct light's backscatter, and the M of each.
template <class Float> struct ThroughMoments {
    Float energy[through_parts + 1];
    Several<Float, through_parts + 1> axis, variance;

    CUTICLE_INLINE void set(int i, const ThroughPart<Float> &part) {
        energy[i] = part.energy;
        axis.set(i, part.axis);
        variance.set(i, part.variance);
    }
};
template <class Float, class Scalar, class Memory, class Channel>
CUTICLE_INLINE ThroughMoments<Float> through_moments(const ThroughTable<Scalar, Memory> &table,
                                                     const ThroughPlace<Float> &at, const Channel &channel,
                                                     const OwnParts<Float> *own = nullptr) {
    using Parts = Several<Float, through_parts + 1>;
    ThroughMoments<Float> moments{{}, Parts(0), Parts(1)};
    for (int p = 0; p < through_parts; ++p) {
        moments.energy[p] = Float(0);
        if (!at.scattered) continue;
        const ThroughPart<Float> others = through_part<Float>(table, at, p, channel);
        const bool its = own && p < lobe_count;  // the last is the others'
        moments.set(p, its ? own_part(others, own->energy[p], own->tilt[p], own->variance[p]) : others);
    }
    moments.set(through_parts, direct_back<Float>(table, at, channel));
    return moments;
}

// M over cos theta_i times the energies: lobes[through_parts + 1].
template <class Float>
CUTICLE_INLINE void through_lobes(const ThroughMoments<Float> &parts, const Float &theta_i, Float *lobes) {
    const auto m = energy_conserving_m(Several<Float, through_parts + 1>(theta_i), parts.axis, parts.variance);
    const Float secant = Float(1) / math::cos_theta(theta_i);
    for (int p = 0; p <= through_parts; ++p) lobes[p] = parts.energy[p] * m[p] * secant;
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

// A part's density of phi in the slot that begins at `first`; column: that of phi.
template <class Value, class Float, class Scalar, class Memory, class Index, class Channel>
CUTICLE_INLINE Value turn_value(const ThroughTable<Scalar, Memory> &table, const ThroughPlace<Float> &at, const Index &first,
                                const Place<Float> &column, int part, const Channel &channel) {
    const int size = table.parts * table.channels, row = table.columns * size;
    const Index lower = first + at.azimuth_row.node * Index(row) + column.node * Index(size) + Index(part * table.channels);
    return bilinear_value<Value>(table.azimuth, lower, row, size, at.azimuth_row.t, column.t, channel);
}
// The density of phi that a part is multiplied by, and that of direct light's backscatter.
template <class Value, class Float, class Scalar, class Memory, class Channel>
CUTICLE_INLINE Value through_turn(const ThroughTable<Scalar, Memory> &table, const ThroughPlace<Float> &at,
                                  const Place<Float> &column, int part, const Channel &channel) {
    using Index = typename ArrayTraits<Float>::Index;
    const int slot = table.azimuth_rows * table.columns * table.parts * table.channels;
    const Index lower = Index(at.random ? through_slots * slot : 0) + (at.strands.node + Index(1)) * Index(slot);
    return math::convex(turn_value<Value>(table, at, lower, column, part, channel),
                        turn_value<Value>(table, at, Index(lower + Index(slot)), column, part, channel), at.strands.t);
}
template <class Value, class Float, class Scalar, class Memory, class Channel>
CUTICLE_INLINE Value direct_back_turn(const ThroughTable<Scalar, Memory> &table, const ThroughPlace<Float> &at,
                                      const Place<Float> &column, const Channel &channel) {
    using Index = typename ArrayTraits<Float>::Index;
    const int slot = table.azimuth_rows * table.columns * table.parts * table.channels;
    const Index first = Index(at.random ? through_slots * slot : 0);
    return turn_value<Value>(table, at, first, column, table.parts - 1, channel);
}

// The densities of phi that the lobes are multiplied by: values[through_parts + 1].
template <class Float, class Scalar, class Memory, class Channel>
CUTICLE_INLINE void through_azimuths(const ThroughTable<Scalar, Memory> &table, const ThroughPlace<Float> &at,
                                     const Float &phi, const Channel &channel, Float *values) {
    const Place<Float> column = locate_azimuth(phi, table.columns);
    for (int p = 0; p < through_parts; ++p)
        values[p] = at.scattered ? through_turn<Float>(table, at, column, p, channel) : Float(0);
    values[through_parts] = direct_back_turn<Float>(table, at, column, channel);
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
    const Index first =
        Index(at.random ? through_slots * slot : 0) + at.azimuth_row.node * Index(row) + ArrayTraits<Float>::to_index(own);
    const Index scattered = first + (at.strands.node + Index(1)) * Index(slot);
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
    const Index lower = (at.node + Index(random ? through_slots - 1 : 0)) * Index(slot), upper = lower + Index(slot);
    return through_energy(between_rows<Float>(table.logs, lower, row, table.channels, 0, channel),
                          between_rows<Float>(table.logs, upper, row, table.channels, 0, channel), Float(0), at);
}

}  // namespace cuticle

#endif  // CUTICLE_SCATTERING_THROUGH_STRANDS_H
