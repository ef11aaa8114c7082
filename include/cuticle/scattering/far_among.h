// The far field of any fibre among strands of a mean fibre, its own parameters being arguments: dual scattering where hair
// varies. Light comes to it directly, or through n others, and the strands behind send some back (through_strands.h). The
// strand keeps its own energies, tilts and widths; what others do to light is the mean fibre's.
//
// Where n is known beforehand, the function is a mixture that can be sampled, as far_field.h's is: the strand alone, and
// each part of what comes through, colour by colour. The density is f cos by luminance over its integral.
#ifndef CUTICLE_SCATTERING_FAR_AMONG_H
#define CUTICLE_SCATTERING_FAR_AMONG_H

#include "cuticle/scattering/dual_scattering.h"
#include "cuticle/scattering/far_field.h"

namespace cuticle {

template <class Scalar, class Memory = const Scalar *> struct MeanStrands {
    ThroughTable<Scalar, Memory> through;           // energies of R, TT and TRT are out of the mean fibre's own
    Scalar tilt[lobe_count], variance[lobe_count];  // of its own M, as FarFibre's
    Scalar d_f, d_b;
};

// How a strand differs from the mean fibre; energy: of its lobes, far_lobes of them.
template <class Float, class Scalar, class Memory>
CUTICLE_HD OwnParts<Float> own_parts(const MeanStrands<Scalar, Memory> &mean, const FarFibre<Float> &fibre,
                                     const Float *energy) {
    OwnParts<Float> own;
    for (int p = 0; p < lobe_count; ++p)
        own.of[p] = {energy[p], fibre.tilt[p] - Float(mean.tilt[p]), fibre.variance[p], Float(mean.variance[p])};
    own.of[lobe_count - 1].energy = own.of[lobe_count - 1].energy + energy[lobe_count];  // the orders past TRT
    return own;
}

// In one channel: the share of light that reaches the strand directly, and the rest, part by part.
template <class Float> struct AmongParts {
    Float lit;
    ThroughMoments<Float> through;
};
template <class Float, class Scalar, class Memory, class Channel>
CUTICLE_HD AmongParts<Float> among_parts(const MeanStrands<Scalar, Memory> &mean, const ThroughPlace<Float> &place,
                                         const Surroundings<Float> &around, const OwnParts<Float> &own,
                                         const Channel &channel) {
    const Shares<Float> share = shares(behind_at<Float>(mean.through.behind, place.row, mean.through.channels, channel),
                                       around, Float(mean.d_f), Float(mean.d_b));
    AmongParts<Float> parts{share.lit, through_moments(mean.through, place, channel, &own)};
    shared(share, mask_all, parts.through.energy);
    return parts;
}

// f in 1/sr, without a cosine, in one channel; alone: the strand's own.
template <class Float, class Scalar, class Memory, class Channel>
CUTICLE_HD Float among_value(const MeanStrands<Scalar, Memory> &mean, const ThroughPlace<Float> &place,
                             const AmongParts<Float> &parts, const Float &theta_i, const Float &phi, const Channel &channel,
                             const Float &alone) {
    Float lobes[through_parts + 1];
    through_lobes(parts.through, theta_i, lobes);
    return add_through(Float(parts.lit * alone), mean.through, place, lobes, phi, channel);
}

// f at one viewer, for one fibre and its surroundings. Prepare it once per shading point.
template <class Float, int Channels> struct FarAmong {
    FarField<Float, Channels> alone;
    ThroughPlace<Float> place;
    AmongParts<Float> parts[Channels];
    Float share[Channels];  // luminance over the luminance of all energy
    Float direct;           // the strand's own share of that
};

template <int Channels, class Float, class Scalar, class Memory, class Weight>
CUTICLE_HD FarAmong<Float, Channels> far_among(Azimuthal form, const MeanStrands<Scalar, Memory> &mean,
                                               const FarFibre<Float> &fibre, const Float &theta_r,
                                               const Float sigma_a[Channels], const Weight luminance[Channels],
                                               const Surroundings<Float> &around) {
    FarAmong<Float, Channels> field;
    field.alone = far_field<Channels>(form, fibre, theta_r, sigma_a, luminance);
    field.place = place_among(mean.through, theta_r, around);
    Float luminous = Float(0);
    field.direct = Float(0);
    for (int c = 0; c < Channels; ++c) {
        const Float *energy = field.alone.energy[c];
        field.parts[c] = among_parts(mean, field.place, around, own_parts(mean, fibre, energy), c);
        for (int p = 0; p < far_lobes; ++p)
            field.direct = field.direct + Float(luminance[c]) * field.parts[c].lit * energy[p];
        for (int p = 0; p <= through_parts; ++p)
            luminous = luminous + Float(luminance[c]) * field.parts[c].through.energy[p];
    }
    luminous = math::max(Float(luminous + field.direct), Float(smallest<Float>));  // nothing may come through many strands
    field.direct = field.direct / luminous;
    for (int c = 0; c < Channels; ++c) field.share[c] = Float(luminance[c]) / luminous;
    return field;
}

// f in 1/sr, without a cosine, into f[Channels]; returns its density, which is among_sample's, 1/sr.
template <class Float, int Channels, class Scalar, class Memory>
CUTICLE_HD Float among_eval(Azimuthal form, const MeanStrands<Scalar, Memory> &mean, const FarAmong<Float, Channels> &field,
                            const Float &theta_i, const Float &phi, Float f[Channels]) {
    for (int c = 0; c < Channels; ++c) f[c] = Float(0);
    if (ArrayTraits<Float>::any(field.direct > Float(0))) far_eval(form, field.alone, theta_i, phi, f);
    Float density = Float(0);
    for (int c = 0; c < Channels; ++c) {
        f[c] = among_value(mean, field.place, field.parts[c], theta_i, phi, c, f[c]);
        density = density + field.share[c] * f[c];
    }
    return density * math::cos_theta(theta_i);
}

// Draws a direction from three numbers in [0, 1); f and the density as among_eval. The first chooses the strand alone or a
// part and colour of what comes through. What is left of it is the first of far_sample, or turns the direction about the
// axis of M. The last chooses the side and the azimuth.
template <class Float, int Channels, class Scalar, class Memory>
CUTICLE_HD Sample<Float> among_sample(Azimuthal form, const MeanStrands<Scalar, Memory> &mean,
                                      const FarAmong<Float, Channels> &field, const Float &u_part, const Float &u_theta,
                                      const Float &u_phi, Float f[Channels]) {
    ChosenPart<Float> chosen = none_chosen(field.direct);
    for (int c = 0; c < Channels; ++c) {
        const ThroughMoments<Float> &through = field.parts[c].through;
        for (int p = 0; p <= through_parts; ++p) chosen = pass_mixture(chosen, u_part, field.share[c], through, p, c);
    }
    const Float left = left_of(chosen, u_part);
    const auto direct = u_part < field.direct;
    Angles<Float> drawn = {Float(0), Float(0)};
    if (ArrayTraits<Float>::any(direct)) drawn = far_draw(form, field.alone, left, u_theta, u_phi);
    if (ArrayTraits<Float>::any(u_part >= field.direct)) {
        const auto nodes = azimuth_nodes(mean.through, field.place, chosen.part, chosen.channel);
        const Angles<Float> through = draw_part(chosen, nodes, left, u_theta, u_phi);
        drawn.theta_i = select(direct, drawn.theta_i, through.theta_i);
        drawn.phi = select(direct, drawn.phi, through.phi);
    }
    return {drawn.theta_i, drawn.phi, among_eval(form, mean, field, drawn.theta_i, drawn.phi, f)};
}

}  // namespace cuticle

#endif  // CUTICLE_SCATTERING_FAR_AMONG_H
