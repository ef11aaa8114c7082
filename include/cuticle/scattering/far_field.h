// The far field of a fibre with every parameter an argument: f, its density and exact samples, without tables.
//
// f cos(theta_i) = Σ_p M_p(theta_i) N_p(phi), p = R, TT, TRT and, in Chiang's form, a rest that is uniform in azimuth. M is
// d'Eon's, which can be sampled exactly. N_p(phi) = ½ ∫ A_p(h) D(phi - phi_p(h)) dh (azimuthal.h): the fibre's half width is
// cut into cells, the light of each leaves evenly between the azimuths of its edges, and D smooths that in closed form, by
// differences of its cdf. So the function is a mixture that can be sampled: a lobe by its energy, a cell by its energy, an
// azimuth within the cell, D's and M's own. The density is f cos by luminance over its integral, of any fibre.
//
// Differs from azimuthal.h in: fewer cells (f off by .25 % of its peak on average over random fibres, by 2 % at worst:
// docs/family.md), and a normal D that is truncated to ±pi where that one is wrapped (1e-4 of its peak at 40°).
#ifndef CUTICLE_SCATTERING_FAR_FIELD_H
#define CUTICLE_SCATTERING_FAR_FIELD_H

#include "cuticle/sampler/sample.h"
#include "cuticle/scattering/far_cells.h"
#include "cuticle/scattering/far_fibre.h"
#include "cuticle/simd/several.h"

namespace cuticle {

// f at one viewer, for one fibre and one colour. Prepare it once per shading point.
template <class Float, int Channels> struct FarField {
    Float edge[far_edges];                       // azimuths at which light through the cells' edges leaves
    Float height[Channels][far_cells];           // of a cell: energy per radian between its edges' azimuths
    Float energy[Channels][far_lobes];           // a lobe's
    Float share[Channels];                       // luminance over the luminance of all energy
    Float axis[far_lobes], variance[far_lobes];  // of M
    Float width;
};

// How finely a number in [0, 1) is split in two: by half its digits.
template <class Float> inline constexpr double far_digits = std::is_same_v<scalar_t<Float>, float> ? 2048. : 67108864.;

// Prepares f for a viewer. luminance: what each channel weighs in the density.
template <int Channels, class Float, class Scalar>
CUTICLE_HD FarField<Float, Channels> far_field(Azimuthal form, const FarFibre<Float> &fibre, const Float &theta_r,
                                               const Float sigma_a[Channels], const Scalar luminance[Channels]) {
    using Cells = Abreast<Float>;
    using Lane = scalar_t<Float>;
    constexpr int step = abreast<Float>;
    const bool closed = form == Azimuthal::normal;
    const Float sine = math::sin(theta_r), cosine = math::cos_theta(theta_r);
    const Cells sin_d(sine), cos_d(cosine), eta(fibre.eta);
    FarField<Float, Channels> field;
    field.width = fibre.width;
    for (int p = 0; p < far_lobes; ++p) {
        field.axis[p] = fibre.tilt[p] - theta_r;
        field.variance[p] = fibre.variance[p];
    }

    // Edges. R: phi = -2 gamma. TRT's whole turn is left out.
    const Float bent = Float(1) / bravais_index(sine, cosine, fibre.eta);
    Float tt[tt_cells + 8], trt[tt_cells + 8];
    for (int j = 0; j < r_cells + 1; j += step)
        store_abreast(Cells(Cells(Lane(-2)) * cell_edges<Float>(true, j).gamma), field.edge, j);
    for (int j = 0; j < tt_cells + 1; j += step) {
        const CellEdges<Cells> at = cell_edges<Float>(false, j);
        const Cells gamma_t = math::asin(Cells(at.sine * Cells(bent)));
        const CrossSection<Cells> ray = {at.gamma, gamma_t, at.gamma, at.gamma};
        store_abreast(exit_azimuth(1, ray), tt, j);
        store_abreast(Cells(exit_azimuth(2, ray) - Cells(Lane(2 * pi<double>))), trt, j);
    }
    for (int j = 0; j < tt_cells + 1; ++j) field.edge[first_tt + 1 + j] = tt[j];
    field.edge[first_trt + 2] = trt[0];
    for (int j = 0; j < tt_cells / tt_in_trt; ++j) {
        // Next to a caustic both edges may leave at one azimuth: a cell spans a little of D at least.
        const Float begin = field.edge[first_trt + 2 + j], span = trt[(j + 1) * tt_in_trt] - begin;
        const Float wide = math::max(Float(math::abs(span)), Float(Float(.001) * fibre.width));
        field.edge[first_trt + 3 + j] = begin + math::copysign(wide, span);
    }
    for (int j = far_cells + lobe_count; j < far_edges; ++j) field.edge[j] = Float(0);

    // Energies.
    for (int j = 0; j < r_cells; j += step) {
        const CellMiddles<Cells> at = cell_middles<Float>(true, j);
        const Cells a = fresnel(Cells(cos_d * at.cosine), eta) * at.width;
        for (int c = 0; c < Channels; ++c) store_abreast(a, field.height[c], j);
    }
    Float part[Channels][tt_cells];
    Cells rest[Channels];
    for (int c = 0; c < Channels; ++c) rest[c] = Cells(Lane(0));
    for (int j = 0; j < tt_cells; j += step) {
        const CellMiddles<Cells> at = cell_middles<Float>(false, j);
        const Cells f = fresnel(Cells(cos_d * at.cosine), eta);
        const CrossSection<Cells> ray = {f, f, f, chord_of(Cells(at.sine * Cells(bent)), sin_d, eta)};
        for (int c = 0; c < Channels; ++c) {
            const Cells absorbed(sigma_a[c]);
            store_abreast(Cells(at.width * attenuation(1, ray, absorbed, closed)), field.height[c], first_tt + j);
            store_abreast(Cells(at.width * attenuation(2, ray, absorbed, closed)), part[c], j);
            if (!closed) rest[c] = rest[c] + at.width * attenuation(3, ray, absorbed, closed);
        }
    }
    Float luminous = Float(0);
    for (int c = 0; c < Channels; ++c) {
        for (int j = 0; j < tt_cells / tt_in_trt; ++j) {
            Float all = part[c][j * tt_in_trt];
            for (int k = 1; k < tt_in_trt; ++k) all = all + part[c][j * tt_in_trt + k];
            field.height[c][first_trt + j] = all;
        }
        for (int p = 0; p < lobe_count; ++p) {
            Cells all(Lane(0));
            for (int j = first_cell(p); j < first_cell(p + 1); j += step) all = all + load_abreast(field.height[c], j);
            field.energy[c][p] = sum_abreast<Float>(all);
        }
        field.energy[c][lobe_count] = sum_abreast<Float>(rest[c]);
        for (int p = 0; p < far_lobes; ++p) luminous = luminous + Float(luminance[c]) * field.energy[c][p];
    }
    for (int c = 0; c < Channels; ++c) field.share[c] = Float(luminance[c]) / luminous;
    for (int p = 0; p < lobe_count; ++p)
        for (int j = first_cell(p); j < first_cell(p + 1); j += step) {
            const Cells span = load_abreast(field.edge, j + p + 1) - load_abreast(field.edge, j + p);
            const Cells over = Cells(Lane(1)) / math::abs(span);
            for (int c = 0; c < Channels; ++c)
                store_abreast(Cells(load_abreast(field.height[c], j) * over), field.height[c], j);
        }
    return field;
}

// f in 1/sr, without a cosine, into f[Channels]; returns its density by luminance, which is far_sample's, 1/sr.
template <class Float, int Channels>
CUTICLE_HD Float far_eval(Azimuthal form, const FarField<Float, Channels> &field, const Float &theta_i, const Float &phi,
                          Float f[Channels]) {
    using Cells = Abreast<Float>;
    using Lane = scalar_t<Float>;
    constexpr int step = abreast<Float>;
    const Float rate = unit_rate(form, field.width), cut = lower_tail(form, Float(Float(pi<Float>) * rate));
    const Cells rates(rate), cuts(cut), kept(Float(Float(1) / (Float(1) - Float(2) * cut)));
    // Light through the fibre's other half leaves at the mirrored azimuths.
    const Float wrapped = math::wrap_angle(phi), sides[2] = {wrapped, Float(-wrapped)};
    Float whole[2][far_edges], rest[2][far_edges];
    for (int s = 0; s < 2; ++s)
        for (int j = 0; j < far_cells + lobe_count; j += step) {
            const Cells away = Cells(sides[s]) - load_abreast(field.edge, j);
            const Turned<Cells> at = turned(form, away, rates, cuts, kept);
            store_abreast(at.whole, whole[s], j);
            store_abreast(at.rest, rest[s], j);
        }
    Several<Float, far_lobes> axis(Lane(0)), variance(Lane(1));
    for (int p = 0; p < far_lobes; ++p) {
        axis.set(p, field.axis[p]);
        variance.set(p, field.variance[p]);
    }
    const auto along = energy_conserving_m(Several<Float, far_lobes>(theta_i), axis, variance);
    for (int c = 0; c < Channels; ++c) f[c] = Float(.5 / pi<double>) * along[lobe_count] * field.energy[c][lobe_count];
    for (int p = 0; p < lobe_count; ++p) {
        Cells around[Channels];
        for (int c = 0; c < Channels; ++c) around[c] = Cells(Lane(0));
        for (int j = first_cell(p); j < first_cell(p + 1); j += step) {
            Cells both(Lane(0));
            for (int s = 0; s < 2; ++s) {
                const Cells w = load_abreast(whole[s], j + p) - load_abreast(whole[s], j + p + 1);
                const Cells r = load_abreast(rest[s], j + p) - load_abreast(rest[s], j + p + 1);
                both = both + math::abs(Cells(w + r));
            }
            for (int c = 0; c < Channels; ++c) around[c] = around[c] + load_abreast(field.height[c], j) * both;
        }
        for (int c = 0; c < Channels; ++c) f[c] = f[c] + Float(.5) * along[p] * sum_abreast<Float>(around[c]);
    }
    const Float secant = Float(1) / math::cos_theta(theta_i);
    Float density = Float(0);
    for (int c = 0; c < Channels; ++c) {
        density = density + field.share[c] * f[c];
        f[c] = f[c] * secant;
    }
    return density;
}

// A cell that a number chooses: the azimuth at which it begins, how far it goes, and what is left of the number.
template <class Float> struct FarCell {
    Float begin, span, left;
};
template <int p, class Float, int Channels>
CUTICLE_INLINE FarCell<Float> far_cell(const FarField<Float, Channels> &field, const Float &u) {
    using Cells = Abreast<Float>;
    constexpr int step = abreast<Float>, first = first_cell(p), count = first_cell(p + 1) - first;
    Float weight[count];
    // u is scaled by the sum in this very order, so that it never selects a cell of no energy.
    for (int j = 0; j < count; j += step) {
        const Cells span = load_abreast(field.edge, first + j + p + 1) - load_abreast(field.edge, first + j + p);
        Cells all(Float(0));
        for (int c = 0; c < Channels; ++c) all = all + Cells(field.share[c]) * load_abreast(field.height[c], first + j);
        store_abreast(Cells(all * math::abs(span)), weight, j);
    }
    Float total = weight[0];
    for (int j = 1; j < count; ++j) total = total + weight[j];
    const Float wanted = u * total;
    Float below = Float(0), passed = Float(0), own = weight[0], begin = field.edge[first + p],
          end = field.edge[first + p + 1];
    for (int j = 1; j < count; ++j) {
        below = below + weight[j - 1];
        const auto past = (wanted >= below) & (weight[j] > Float(0));
        passed = select(past, below, passed);
        own = select(past, weight[j], own);
        begin = select(past, field.edge[first + j + p], begin);
        end = select(past, field.edge[first + j + p + 1], end);
    }
    return {begin, Float(end - begin), math::clamp(Float((wanted - passed) / own), Float(0), Float(1))};
}

// Draws a direction from three numbers in [0, 1). The first chooses the lobe; what is left of it gives D, and its lower
// digits the azimuth around the lobe's axis. The last chooses the side of the fibre, the cell, and where in it.
template <class Float, int Channels>
CUTICLE_HD Angles<Float> far_draw(Azimuthal form, const FarField<Float, Channels> &field, const Float &u_lobe,
                                  const Float &u_theta, const Float &u_phi) {
    const Float side = Float(2) * u_phi, u_cell = side - math::floor(side);
    Float below = Float(0), start = Float(0), chance = Float(0), axis = field.axis[0], variance = field.variance[0];
    FarCell<Float> cell = {Float(0), Float(0), Float(0)};
    auto rest = u_lobe < Float(0);
    for (int p = 0; p < far_lobes; ++p) {
        Float own = Float(0);
        for (int c = 0; c < Channels; ++c) own = own + field.share[c] * field.energy[c][p];
        const auto past = (u_lobe >= below) & (own > Float(0));
        start = select(past, below, start);
        chance = select(past, own, chance);
        axis = select(past, field.axis[p], axis);
        variance = select(past, field.variance[p], variance);
        below = below + own;
        if (p == lobe_count) {
            rest = past;
        } else if (ArrayTraits<Float>::any(past & (u_lobe < below))) {
            const FarCell<Float> here = p == 0   ? far_cell<0>(field, u_cell)
                                        : p == 1 ? far_cell<1>(field, u_cell)
                                                 : far_cell<2>(field, u_cell);
            cell.begin = select(past, here.begin, cell.begin);
            cell.span = select(past, here.span, cell.span);
            cell.left = select(past, here.left, cell.left);
        }
    }
    const Float left = math::clamp(Float((u_lobe - start) / chance), Float(0), Float(1 - .5 * epsilon<Float>));
    const Float digits = left * Float(far_digits<Float>);
    const Float theta_i = about_axis(axis, variance, u_theta, Float(Float(2 * pi<double>) * (digits - math::floor(digits))));
    const Float turn = cell.begin + cell.left * cell.span + turn_of(form, left, field.width);
    const Float leaving = select(side < Float(1), turn, Float(-turn));
    return {theta_i, Float(math::wrap_angle(Float(select(rest, Float(Float(2 * pi<double>) * u_phi), leaving))))};
}

// The same, with f as far_eval and its density.
template <class Float, int Channels>
CUTICLE_HD Sample<Float> far_sample(Azimuthal form, const FarField<Float, Channels> &field, const Float &u_lobe,
                                    const Float &u_theta, const Float &u_phi, Float f[Channels]) {
    const Angles<Float> drawn = far_draw(form, field, u_lobe, u_theta, u_phi);
    return {drawn.theta_i, drawn.phi, far_eval(form, field, drawn.theta_i, drawn.phi, f)};
}

}  // namespace cuticle

#endif  // CUTICLE_SCATTERING_FAR_FIELD_H
