// Draws directions from what comes through a fixed number of strands, all colours together: for renderers that know how many
// there are only once they have a direction. The parts are those of through_strands.h; the mixture of their M and of their
// densities of azimuth, linear between nodes, is drawn from exactly.
#ifndef CUTICLE_SCATTERING_THROUGH_DRAW_H
#define CUTICLE_SCATTERING_THROUGH_DRAW_H

#include "cuticle/scattering/through_strands.h"

namespace cuticle {

inline constexpr int draw_columns = 1 + along_columns;  // the energy, then those of ThroughTable::along

template <class Scalar, class Memory = const Scalar *> struct ThroughDraw {
    Memory lobes;    // [row][part][column], theta_r from -limit to limit; the energies are out of the strand's own parts'
    Memory azimuth;  // [azimuth row][part][node][density, its integral from 0], phi from 0 to pi; in all ½
    int rows, azimuth_rows, nodes;
    Scalar limit;
};

// The parts for one viewer and strand; their shares sum to 1.
template <class Float> struct ThroughMixture {
    ThroughMoments<Float> parts;  // without direct light's backscatter
    Place<Float> azimuth_row;
};

// `own`: energies of the strand's parts by luminance, and its own M.
template <class Float, class Scalar, class Memory>
CUTICLE_HD ThroughMixture<Float> through_mixture(const ThroughDraw<Scalar, Memory> &table, const Float &theta_r,
                                                 const OwnParts<Float> &own) {
    using Index = typename ArrayTraits<Float>::Index;
    const Place<Float> row = locate_viewer(theta_r, table.rows, Float(table.limit));
    const auto value = [&](int column) {
        return between_rows<Float>(table.lobes, Index(0), row, through_parts * draw_columns, column, 0);
    };
    ThroughMixture<Float> mix;
    mix.azimuth_row = locate_viewer(theta_r, table.azimuth_rows, Float(table.limit));
    Float total = Float(0);
    for (int p = 0; p < through_parts; ++p) {
        const int first = p * draw_columns;
        Float columns[along_columns];
        for (int k = 0; k < along_columns; ++k) columns[k] = value(first + 1 + k);
        ThroughPart<Float> part = part_of(value(first), columns);
        if (p < lobe_count) part = own_part(part, own.of[p]);
        mix.parts.set(p, part);
        total = total + part.energy;
    }
    for (int p = 0; p < through_parts; ++p) mix.parts.energy[p] = mix.parts.energy[p] / total;
    mix.parts.energy[through_parts] = Float(0);
    return mix;
}

// The density of through_sample, 1/sr.
template <class Float, class Scalar, class Memory>
CUTICLE_HD Float through_pdf(const ThroughDraw<Scalar, Memory> &table, const ThroughMixture<Float> &mix,
                             const Float &theta_i, const Float &phi) {
    using Index = typename ArrayTraits<Float>::Index;
    const Place<Float> column = locate_azimuth(phi, table.nodes);
    const int row = through_parts * table.nodes * 2;
    Float lobes[through_parts + 1], sum = Float(0);
    part_lobes_at(mix.parts, theta_i, lobes);
    for (int p = 0; p < through_parts; ++p) {
        const Index i = mix.azimuth_row.node * Index(row) + column.node * Index(2) + Index(p * table.nodes * 2);
        const Float around = bilinear_value<Float>(table.azimuth, i, row, 2, mix.azimuth_row.t, column.t, 0);
        sum = sum + lobes[p] * around;
    }
    return sum;
}

// The first number chooses the part, and what is left of it turns the direction about the axis of M. The last chooses the
// side, one of two rows of azimuths, and phi.
template <class Float, class Scalar, class Memory>
CUTICLE_HD Sample<Float> through_sample(const ThroughDraw<Scalar, Memory> &table, const ThroughMixture<Float> &mix,
                                        const Float &u_part, const Float &u_theta, const Float &u_phi) {
    using Index = typename ArrayTraits<Float>::Index;
    ChosenPart<Float> chosen = none_chosen(Float(0));
    for (int p = 0; p < through_parts; ++p) chosen = pass_mixture(chosen, u_part, Float(1), mix.parts, p, 0);
    const Float left = left_of(chosen, u_part);
    const Float theta_i = about_axis(chosen.axis, chosen.variance, u_theta, Float(Float(2 * pi<double>) * left));

    const Float side = Float(2) * u_phi, u = side - math::floor(side), t = mix.azimuth_row.t;
    const auto upper = u >= Float(1) - t;
    const Float wanted = Float(.5) * math::clamp(select(upper, Float((u - (Float(1) - t)) / math::max(t, Float(1e-6))),
                                                        Float(u / math::max(Float(Float(1) - t), Float(1e-6)))),
                                                 Float(0), Float(1));
    const Index row = mix.azimuth_row.node + ArrayTraits<Float>::to_index(Float(select(upper, Float(1), Float(0))));
    const Index first = (row * Index(through_parts) + ArrayTraits<Float>::to_index(chosen.part)) * Index(table.nodes * 2);
    const auto at = [&](int i) { return Float(ArrayTraits<Float>::gather(table.azimuth, Index(first + Index(i)))); };
    Float from = at(0), to = at(2), passed = Float(0), node = Float(0);
    for (int j = 1; j + 1 < table.nodes; ++j) {
        const Float integral = at(2 * j + 1);
        const auto past = wanted >= integral;
        from = select(past, at(2 * j), from);
        to = select(past, at(2 * j + 2), to);
        passed = select(past, integral, passed);
        node = select(past, Float(j), node);
    }
    const Float step = Float(pi<double>) / Float(table.nodes - 1);
    const Float within = linear_quantile(from, to, Float(Float(2) * (wanted - passed) / step));
    const Float turn = (node + within) * step, phi = select(side < Float(1), turn, Float(-turn));
    return {theta_i, phi, through_pdf(table, mix, theta_i, phi)};
}

}  // namespace cuticle

#endif  // CUTICLE_SCATTERING_THROUGH_DRAW_H
