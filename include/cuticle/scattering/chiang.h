// Chiang et al. 2016, "A Practical and Controllable Hair and Fur Model for Production Path Tracing".
//
// Near field: the offset h at which the viewer's ray meets the fibre is known, so each lobe lies around one azimuth:
// f cos(theta_i) = Σ_p A_p(h) M_p(theta_i) N_p(phi - phi_p(h)), p = R, TT, TRT and a last lobe, uniform in azimuth, for all
// orders past TRT. Lobes are drawn in proportion to the luminance of A_p, so that the pdf equals f cos up to colour.
// Far field: h is integrated over the width of the fibre; azimuthal.h tabulates it with the logistic distribution.
//
// Differs from the paper, and from hosts, in: exp(-x) I0(x) is accurate to 5e-7 (longitudinal.h); alpha > 0 means scales
// that lean toward the root, which moves R toward the root.
#ifndef CUTICLE_SCATTERING_CHIANG_H
#define CUTICLE_SCATTERING_CHIANG_H

#include "cuticle/math/logistic.h"
#include "cuticle/sampler/sample.h"
#include "cuticle/scattering/marschner.h"

namespace cuticle {

inline constexpr int chiang_lobes = lobe_count + 1;  // the last holds every order past TRT

template <class Float> struct ChiangFibre {
    Float eta, scale;                                  // scale of the azimuthal logistic distribution, radians
    Float variance[chiang_lobes], tilt[chiang_lobes];  // in theta: of M, and of the lobe's axis (radians)
};

// Each lobe at one viewer and offset.
template <class Float> struct ChiangState {
    CrossSection<Float> ray;
    Float axis[chiang_lobes];         // theta around which M is centred
    Float azimuth[lobe_count];        // phi_p
    Float probability[chiang_lobes];  // of being drawn; they sum to 1
};

// sigma_a and luminance hold one value per channel. A lobe's probability is the luminance of A_p; with a null pointer it
// makes the mean over channels of 1/ESS least: for lobes that do not overlap, it is the root of Σ_c (A_p,c / Σ_p A_p,c)².
template <class Float, class Scalar, class Absorption>
CUTICLE_HD ChiangState<Float> chiang_state(const ChiangFibre<Scalar> &fibre, const Float &theta_r, const Float &h,
                                           const Absorption *sigma_a, const Scalar *luminance, int channels) {
    ChiangState<Float> state;
    state.ray =
        cross_section(Float(math::asin(h)), Float(math::sin(theta_r)), Float(math::cos_theta(theta_r)), Float(fibre.eta));
    for (int p = 0; p < chiang_lobes; ++p) {
        state.axis[p] = Float(fibre.tilt[p]) - theta_r;
        if (p < lobe_count) state.azimuth[p] = exit_azimuth(p, state.ray);
        state.probability[p] = Float(0);
    }
    for (int c = 0; c < channels; ++c) {
        Float a[chiang_lobes], all = Float(0);
        for (int p = 0; p < chiang_lobes; ++p) {
            a[p] = attenuation(p, state.ray, Float(sigma_a[c]), false);
            all = all + a[p];
        }
        for (int p = 0; p < chiang_lobes; ++p)
            state.probability[p] =
                state.probability[p] + (luminance ? Float(luminance[c]) * a[p] : math::sqr(Float(a[p] / all)));
    }
    Float total = Float(0);
    for (int p = 0; p < chiang_lobes; ++p) {
        if (!luminance) state.probability[p] = math::sqrt(state.probability[p]);
        total = total + state.probability[p];
    }
    for (int p = 0; p < chiang_lobes; ++p) state.probability[p] = state.probability[p] / total;
    return state;
}

// M_p N_p: a density per steradian.
template <class Float, class Scalar>
CUTICLE_HD Float chiang_lobe(const ChiangFibre<Scalar> &fibre, const ChiangState<Float> &state, int p, const Float &theta_i,
                             const Float &phi) {
    const Float m = energy_conserving_m(theta_i, state.axis[p], Float(fibre.variance[p]));
    if (p == lobe_count) return m * Float(.5 / pi<double>);
    return m * trimmed_logistic(math::wrap_angle(Float(phi - state.azimuth[p])), Float(fibre.scale));
}

// f in 1/sr, without a cosine, into f[channels]; `lobes` as LobeMask, mask_back for the orders past TRT.
template <class Float, class Scalar, class Absorption>
CUTICLE_HD void chiang_eval(const ChiangFibre<Scalar> &fibre, const ChiangState<Float> &state, const Absorption *sigma_a,
                            int channels, int lobes, const Float &theta_i, const Float &phi, Float *f) {
    for (int c = 0; c < channels; ++c) f[c] = Float(0);
    const Float secant = Float(1) / math::cos_theta(theta_i);
    for (int p = 0; p < chiang_lobes; ++p) {
        if (!(lobes & (1 << p))) continue;
        const Float value = chiang_lobe(fibre, state, p, theta_i, phi) * secant;
        for (int c = 0; c < channels; ++c) f[c] = f[c] + value * attenuation(p, state.ray, Float(sigma_a[c]), false);
    }
}

// Density of chiang_sample, 1/sr.
template <class Float, class Scalar>
CUTICLE_HD Float chiang_pdf(const ChiangFibre<Scalar> &fibre, const ChiangState<Float> &state, const Float &theta_i,
                            const Float &phi) {
    Float sum = Float(0);
    for (int p = 0; p < chiang_lobes; ++p) sum = sum + state.probability[p] * chiang_lobe(fibre, state, p, theta_i, phi);
    return sum;
}

// Draws a direction from three numbers in [0, 1). The first chooses the lobe and, rescaled, gives the azimuth around the
// lobe's axis (d'Eon, Marschner and Hanika 2013), so that theta is drawn about the tilted axis itself.
template <class Float, class Scalar>
CUTICLE_HD Sample<Float> chiang_sample(const ChiangFibre<Scalar> &fibre, const ChiangState<Float> &state,
                                       const Float &u_lobe, const Float &u_theta, const Float &u_phi) {
    Float below = Float(0), start = Float(0), width = state.probability[0];
    Float axis = state.axis[0], variance = Float(fibre.variance[0]), azimuth = state.azimuth[0];
    auto rest = u_lobe < Float(0);
    for (int p = 1; p < chiang_lobes; ++p) {
        below = below + state.probability[p - 1];
        const auto here = (u_lobe >= below) & (state.probability[p] > Float(0));
        start = select(here, below, start);
        width = select(here, state.probability[p], width);
        axis = select(here, state.axis[p], axis);
        variance = select(here, Float(fibre.variance[p]), variance);
        if (p < lobe_count) azimuth = select(here, state.azimuth[p], azimuth);
        else rest = here;
    }
    const Float left = math::clamp(Float((u_lobe - start) / width), Float(0), Float(1));
    const Float theta_i = about_axis(axis, variance, u_theta, Float(Float(2 * pi<double>) * left));
    const Float about = select(rest, Float(Float(2 * pi<double>) * u_phi - Float(pi<double>)),
                               Float(azimuth + trimmed_logistic_inverse(u_phi, Float(fibre.scale))));
    const Float phi = math::wrap_angle(about);
    return {theta_i, phi, chiang_pdf(fibre, state, theta_i, phi)};
}

// The far field's last lobe: A of the orders past TRT, averaged over h, for viewers at i (pi/2) / (rows - 1):
// [rows][channels].
template <class Scalar, class Memory = const Scalar *> struct ChiangRest {
    Memory energy;
    int rows, channels;
    Scalar variance;  // of its M, in theta
};

// Its part of f, which is the same for all phi.
template <class Value, class Float>
CUTICLE_HD Value chiang_rest(const Value &energy, const Float &theta_i, const Float &theta_r, const Float &variance) {
    return energy_conserving_m(theta_i, Float(-theta_r), variance) / math::cos_theta(theta_i) * energy *
           Float(.5 / pi<double>);
}

// The energy at a viewer, of the channel `channel` of the table.
template <class Value, class Float, class Scalar, class Memory, class Index>
CUTICLE_INLINE Value rest_energy(const ChiangRest<Scalar, Memory> &rest, const Float &theta_r, const Index &channel) {
    using Traits = ArrayTraits<Value>;
    const Place<Float> row = locate_inclination(theta_r, rest.rows);
    const Index at = row.node * Index(rest.channels) + channel;
    return math::convex(Value(Traits::gather(rest.energy, at)),
                        Value(Traits::gather(rest.energy, Index(at + Index(rest.channels)))), row.t);
}

// The same for a viewer and a channel, an int or a ChannelBetween: the constant that marschner_terms leaves 0.
template <class Float, class Scalar, class Memory, class Channel>
CUTICLE_HD Float chiang_far_rest(const ChiangRest<Scalar, Memory> &rest, const Float &theta_i, const Float &theta_r,
                                 const Channel &channel) {
    using Index = typename ArrayTraits<Float>::Index;
    Float energy;
    if constexpr (std::is_integral_v<Channel>) energy = rest_energy<Float>(rest, theta_r, Index(channel));
    else
        energy = between_absorptions(rest_energy<Float>(rest, theta_r, channel.first),
                                     rest_energy<Float>(rest, theta_r, Index(channel.first + Index(1))), channel.t);
    return chiang_rest(energy, theta_i, theta_r, Float(rest.variance));
}

// marschner_terms of the far field: R, TT and TRT, whose azimuthal tables are logistic, and the rest.
template <class Float, class Scalar, class Memory>
CUTICLE_HD void chiang_far_terms(const FibreLobes<Scalar> &fibre, const ChiangRest<Scalar, Memory> &rest,
                                 const Float &theta_i, const Float &theta_r, int lobes, AzimuthalTerms<Float> *terms) {
    marschner_terms(fibre, theta_i, theta_r, lobes, rest.channels, terms);
    if (lobes & mask_back)
        for (int c = 0; c < rest.channels; ++c) terms[c].constant = chiang_far_rest(rest, theta_i, theta_r, c);
}

}  // namespace cuticle

#endif  // CUTICLE_SCATTERING_CHIANG_H
