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
enum ThroughColumn { through_log_energy, through_bend, through_axis, through_variance, through_columns };
enum Arrangement { counted_sheets, random_strands };

template <class Scalar, class Memory = const Scalar *> struct ThroughTable {
    Memory lobes;    // [arrangement][slot][row][column][part][channel], theta_r from -limit to limit
    Memory azimuth;  // [arrangement][slot][azimuth row][column][part][channel], the same theta_r; phi from 0 to pi
    Memory behind;   // [row][Behind][channel]
    int rows, azimuth_rows, columns, channels;
    Scalar limit;
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
    int arrangement;
    bool scattered;  // whether any light met other strands: else no part is looked up
};
template <class Float, class Scalar, class Memory>
CUTICLE_INLINE ThroughPlace<Float> locate(const ThroughTable<Scalar, Memory> &table, const Float &theta_r,
                                          const Float &strands, Arrangement arrangement, bool scattered) {
    const Float limit = Float(table.limit);
    return {locate_strands(strands), locate_viewer(theta_r, table.rows, limit),
            locate_viewer(theta_r, table.azimuth_rows, limit), arrangement, scattered};
}

// A channel's values, and those between two channels.
template <class Float, class Memory, class Index>
CUTICLE_INLINE Float channel_value(const Memory &data, const Index &first, int channel) {
    return ArrayTraits<Float>::gather(data, Index(first + Index(channel)));
}
template <class Float, class Memory, class Index>
CUTICLE_INLINE Float channel_value(const Memory &data, const Index &first, const ChannelBetween<Float> &channel) {
    const Index lower = first + channel.first;
    return math::linear(Float(ArrayTraits<Float>::gather(data, lower)),
                        Float(ArrayTraits<Float>::gather(data, Index(lower + Index(1)))),
                        math::clamp(channel.t, Float(0), Float(1)));
}

// How a strand differs from the others, for which the tables were made: its parts' energies are those times `energy`, and
// its own M lies `tilt` further and is wider by `variance` (radians, theta).
template <class Float> struct OwnParts {
    Float energy[lobe_count], tilt[lobe_count], variance[lobe_count];
};
template <class Float> CUTICLE_INLINE Float widened(const Float &variance, const Float &by) {
    return math::max(Float(variance + by), Float(1e-4));
}

// The energies of all parts, then that of direct light's backscatter, and the M of each.
template <class Float> struct ThroughMoments {
    Float energy[through_parts + 1];
    Several<Float, through_parts + 1> axis, variance;
};
template <class Float, class Scalar, class Memory, class Channel>
CUTICLE_INLINE ThroughMoments<Float> through_moments(const ThroughTable<Scalar, Memory> &table,
                                                     const ThroughPlace<Float> &at, const Channel &channel,
                                                     const OwnParts<Float> *own = nullptr) {
    using Index = typename ArrayTraits<Float>::Index;
    const int size = through_columns * through_parts * table.channels, slot = table.rows * size;
    const Index first = Index(at.arrangement * through_slots * slot) + at.row.node * Index(size);
    const auto value = [&](const Index &from, int column, int part) {
        const Index i = from + Index((column * through_parts + part) * table.channels);
        return math::linear(channel_value<Float>(table.lobes, i, channel),
                            channel_value<Float>(table.lobes, Index(i + Index(size)), channel), at.row.t);
    };
    const Index lower = first + (at.strands.node + Index(1)) * Index(slot), upper = lower + Index(slot);
    using Parts = Several<Float, through_parts + 1>;
    ThroughMoments<Float> moments{{}, Parts(0), Parts(1)};
    for (int p = 0; p < through_parts; ++p) {
        moments.energy[p] = Float(0);
        if (!at.scattered) continue;
        const auto between = [&](int column) {
            return math::linear(value(lower, column, p), value(upper, column, p), at.strands.t);
        };
        moments.energy[p] = through_energy(value(lower, through_log_energy, p), value(upper, through_log_energy, p),
                                           value(lower, through_bend, p), at.strands);
        moments.axis.set(p, between(through_axis));
        moments.variance.set(p, between(through_variance));
        if (!own || p == lobe_count) continue;  // the last is the others'
        moments.energy[p] = moments.energy[p] * own->energy[p];
        moments.axis.set(p, Float(between(through_axis) + own->tilt[p]));
        moments.variance.set(p, widened(Float(between(through_variance)), own->variance[p]));
    }
    constexpr int back = through_parts - 1;
    moments.energy[through_parts] = math::exp(value(first, through_log_energy, back));
    moments.axis.set(through_parts, value(first, through_axis, back));
    moments.variance.set(through_parts, value(first, through_variance, back));
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
template <class Float, class Scalar, class Memory, class Channel>
CUTICLE_HD Behind<Float> behind_at(const ThroughTable<Scalar, Memory> &table, const Place<Float> &row,
                                   const Channel &channel) {
    using Index = typename ArrayTraits<Float>::Index;
    const auto value = [&](int j) {
        const Index i = row.node * Index(3 * table.channels) + Index(j * table.channels);
        return math::linear(channel_value<Float>(table.behind, i, channel),
                            channel_value<Float>(table.behind, Index(i + Index(3 * table.channels)), channel), row.t);
    };
    return {value(0), value(1), value(2)};
}

// The densities of phi that the lobes are multiplied by: values[through_parts + 1].
template <class Float, class Scalar, class Memory, class Channel>
CUTICLE_INLINE void through_azimuths(const ThroughTable<Scalar, Memory> &table, const ThroughPlace<Float> &at,
                                     const Float &phi, const Channel &channel, Float *values) {
    using Index = typename ArrayTraits<Float>::Index;
    const Place<Float> column = locate_azimuth(phi, table.columns);
    const int size = through_parts * table.channels, row = table.columns * size, slot = table.azimuth_rows * row;
    const Index first =
        Index(at.arrangement * through_slots * slot) + at.azimuth_row.node * Index(row) + column.node * Index(size);
    const auto value = [&](const Index &from, int part) {
        const Index i = from + Index(part * table.channels);
        return math::bilinear(channel_value<Float>(table.azimuth, i, channel),
                              channel_value<Float>(table.azimuth, Index(i + Index(size)), channel),
                              channel_value<Float>(table.azimuth, Index(i + Index(row)), channel),
                              channel_value<Float>(table.azimuth, Index(i + Index(row + size)), channel), at.azimuth_row.t,
                              column.t);
    };
    const Index lower = first + (at.strands.node + Index(1)) * Index(slot), upper = lower + Index(slot);
    for (int p = 0; p < through_parts; ++p)
        values[p] = at.scattered ? Float(math::convex(value(lower, p), value(upper, p), at.strands.t)) : Float(0);
    values[through_parts] = value(first, through_parts - 1);
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
template <class Float, class Memory> CUTICLE_INLINE int node_count(const AzimuthNodes<Float, Memory> &of) {
    return of.nodes;
}
template <class Float, class Memory> CUTICLE_INLINE Float node_density(const AzimuthNodes<Float, Memory> &of, int node) {
    using Index = typename ArrayTraits<Float>::Index;
    const auto seen = [&](const Index &i) {
        return math::linear(Float(ArrayTraits<Float>::gather(of.values, i)),
                            Float(ArrayTraits<Float>::gather(of.values, Index(i + Index(of.row)))), of.between_rows);
    };
    return math::convex(seen(Index(of.lower + Index(node * of.node))), seen(Index(of.upper + Index(node * of.node))),
                        of.between_strands);
}
// `part`: up to through_parts, which is direct light's backscatter.
template <class Float, class Scalar, class Memory>
CUTICLE_HD AzimuthNodes<Float, Memory> azimuth_nodes(const ThroughTable<Scalar, Memory> &table,
                                                     const ThroughPlace<Float> &at, const Float &part,
                                                     const Float &channel) {
    using Index = typename ArrayTraits<Float>::Index;
    const int size = through_parts * table.channels, row = table.columns * size, slot = table.azimuth_rows * row;
    const auto direct = part > Float(lobe_count);
    const Float own = math::min(part, Float(lobe_count));
    const Index first = Index(at.arrangement * through_slots * slot) + at.azimuth_row.node * Index(row) +
                        ArrayTraits<Float>::to_index(Float(own * Float(table.channels) + channel));
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
    Memory logs;  // [arrangement][0 (sheets: 1), 1, 2, 4, 8 and 16 strands][row][channel], theta_i from -limit to limit
    int rows, channels;
    Scalar limit;
};

// Of light that met a strand: `strands` in all where they are counted, or expected of a Poisson number of them.
template <class Float, class Scalar, class Memory, class Channel>
CUTICLE_HD Float transmittance(const TransmittanceTable<Scalar, Memory> &table, const Float &theta_i, const Float &strands,
                               Arrangement arrangement, const Channel &channel) {
    using Index = typename ArrayTraits<Float>::Index;
    const StrandsPlace<Float> at = locate_strands(strands);
    const Place<Float> row = locate_viewer(theta_i, table.rows, Float(table.limit));
    const int slot = table.rows * table.channels;
    const Index lower =
        (at.node + Index(arrangement * (through_slots - 1))) * Index(slot) + row.node * Index(table.channels);
    const auto value = [&](const Index &i) {
        return math::linear(channel_value<Float>(table.logs, i, channel),
                            channel_value<Float>(table.logs, Index(i + Index(table.channels)), channel), row.t);
    };
    return through_energy(value(lower), value(Index(lower + Index(slot))), Float(0), at);
}

}  // namespace cuticle

#endif  // CUTICLE_SCATTERING_THROUGH_STRANDS_H
