// Dual scattering (Zinke, Yuksel, Weber, Keyser 2008): f for light that reaches a strand directly or through n others.
//
// Differs from the paper in (exact only): the backscatter sums all orders; every part is normalised to the energy it
// stands for; forward scattering shifts light as well as spreading it; no factor pi before the backscatter of spread
// light. Between 0 and 1 strands both formulations blend the two cases, as the paper's direct fraction does.
#ifndef CUTICLE_DUAL_SCATTERING_H
#define CUTICLE_DUAL_SCATTERING_H

#include "cuticle/multiple_scattering.h"

namespace cuticle {

// Averages on inclinations i: -limit + 2 limit i / (rows - 1): [rows][channels][average_columns].
template <class Scalar, class Memory = const Scalar *> struct AverageTable {
    Memory data;
    int rows;
    Scalar limit;
};

template <class Scalar, class Memory = const Scalar *> struct DualScatteringModel {
    FibreLobes<Scalar> fibre;               // its form is longitudinal_of(formulation)
    AzimuthalTable<Memory> direct, spread;  // N_p and N^G_p
    AverageTable<Scalar, Memory> averages;
    Formulation formulation;
    Scalar d_f, d_b;
};

template <class Float, class Scalar, class Memory, class Channel>
CUTICLE_HD Averages<Float> averages_at(const AverageTable<Scalar, Memory> &table, const Float &theta, const Channel &channel,
                                       int channels) {
    using Traits = ArrayTraits<Float>;
    using Index = typename Traits::Index;
    const Float last = Float(table.rows - 1);
    const Float x = math::clamp(Float((theta / Float(table.limit) + Float(1)) * Float(.5) * last), Float(0), last);
    const Index i = math::min(Traits::to_index(x), Index(table.rows - 2));
    const Float t = x - Float(i);
    const Index first = (i * Index(channels) + Index(channel)) * Index(average_columns);
    const auto at = [&](int column) {
        const Float lower = Traits::gather(table.data, Index(first + Index(column)));
        const Float upper = Traits::gather(table.data, Index(first + Index(column + channels * average_columns)));
        return Float(lower + t * (upper - lower));
    };
    return {at(0), at(1), at(2), at(3), at(4), at(5), at(6), at(7), at(8)};
}

template <class Float, class Scalar, class Memory>
CUTICLE_HD Averages<Float> averages_at(const AverageTable<Scalar, Memory> &table, const Float &theta,
                                       const ChannelBetween<Float> &channel, int channels) {
    using Index = typename ArrayTraits<Float>::Index;
    const Averages<Float> a = averages_at(table, theta, channel.first, channels);
    const Averages<Float> b = averages_at(table, theta, Index(channel.first + Index(1)), channels);
    const Float t = math::clamp(channel.t, Float(0), Float(1));
    const auto mix = [&](const Float &x, const Float &y) { return Float(x + t * (y - x)); };
    return {mix(a.a_f, b.a_f),
            mix(a.a_b, b.a_b),
            mix(a.alpha_f, b.alpha_f),
            mix(a.alpha_b, b.alpha_b),
            mix(a.beta_f, b.beta_f),
            mix(a.beta_b, b.beta_b),
            mix(a.back_energy, b.back_energy),
            mix(a.back_shift, b.back_shift),
            mix(a.back_deviation, b.back_deviation)};
}

// The backscatter lobe, independent of phi, for light spread by `variance` and shifted by `shift` before (theta_h).
// exact: ∫ f cos over the back half is A_b. zinke2008: as printed, 2 A_b g / (pi cos² theta_d).
template <class Float>
CUTICLE_HD Float backscatter(Formulation formulation, const Averages<Float> &a, const Float &theta_i, const Float &theta_r,
                             const Float &shift, const Float &variance) {
    const bool exact = formulation == Formulation::exact;
    const Float m = longitudinal(longitudinal_of(formulation), theta_i, theta_r, Float(a.back_shift + shift),
                                 Float(a.back_deviation * a.back_deviation + variance));
    return (exact ? Float(1) : Float(2)) * a.back_energy * m * Float(1 / pi<double>);
}

// Turns the direct rows' weights of marschner_terms into what f is around the fibre for n >= 0 strands, whole or not,
// between it and the light, in one channel: an int or a ChannelBetween.
template <class Float, class Scalar, class Memory, class Channel>
CUTICLE_HD void add_surroundings(const DualScatteringModel<Scalar, Memory> &model, const Channel &channel,
                                 const Float &theta_i, const Float &theta_r, const Float &strands, int lobes,
                                 AzimuthalTerms<Float> &t) {
    const bool exact = model.formulation == Formulation::exact;
    const Float lit = math::max(Float(Float(1) - strands), Float(0));  // directly lit share
    const Float n = math::max(strands, Float(1));
    // `exact` takes every average at the viewer's inclination, so that each part's energy is known in closed form.
    const Float inclination = azimuthal_inclination(model.fibre.form, theta_i, theta_r);
    const Averages<Float> a = averages_at(model.averages, inclination, channel, model.direct.channels);
    if (ArrayTraits<Float>::any(lit > Float(0))) {
        if (lobes & mask_back)
            t.constant = lit * Float(model.d_b) * backscatter(model.formulation, a, theta_i, theta_r, Float(0), Float(0));
        for (int p = 0; p < lobe_count; ++p) t.weight[direct_rows][p] = lit * t.weight[direct_rows][p];
    }
    if (!ArrayTraits<Float>::any(lit < Float(1))) return;
    const Float spread = n * a.beta_f * a.beta_f, shift = exact ? Float(n * a.alpha_f) : Float(0);
    const Float density = Float(model.d_f) * (exact ? Float(1) : Float(model.d_f));  // printed twice: T_f holds one
    const Float transmittance = math::decay(Float(n * math::log(math::max(a.a_f, Float(smallest<Float>)))));
    const Float share = (Float(1) - lit) * density * transmittance;
    for (int p = 0; p < lobe_count; ++p)
        if (lobes & (1 << p))
            t.weight[spread_rows][p] =
                share * longitudinal(model.fibre.form, theta_i, theta_r, Float(Float(model.fibre.alpha[p]) + shift),
                                     Float(Float(model.fibre.beta[p] * model.fibre.beta[p]) + spread));
    if (lobes & mask_back)
        t.constant = t.constant + share * Float(exact ? 1. : pi<double>) * Float(model.d_b) *
                                      backscatter(model.formulation, a, theta_i, theta_r, shift, spread);
}

// The same for every channel of the tables: terms[channels].
template <class Float, class Scalar, class Memory>
CUTICLE_HD void dual_scattering_terms(const DualScatteringModel<Scalar, Memory> &model, const Float &theta_i,
                                      const Float &theta_r, const Float &strands, int lobes, AzimuthalTerms<Float> *terms) {
    const int channels = model.direct.channels;
    const bool some_lit = ArrayTraits<Float>::any(strands < Float(1));
    marschner_terms(model.fibre, theta_i, theta_r, some_lit ? lobes : 0, channels, terms);
    for (int c = 0; c < channels; ++c) add_surroundings(model, c, theta_i, theta_r, strands, lobes, terms[c]);
}

// f of one channel in 1/sr, without a cosine, from its terms, at a place that `locate` found in model.direct; the spread
// table has the same rows and columns.
template <class Float, class Scalar, class Memory, class Channel>
CUTICLE_HD Float sum_around(const DualScatteringModel<Scalar, Memory> &model, const AzimuthalTerms<Float> &terms,
                            const Bilinear<Float> &at, const Channel &channel, const Float &strands) {
    Float f = terms.constant;
    if (ArrayTraits<Float>::any(strands < Float(1))) f = add_rows(f, model.direct, terms, direct_rows, at, channel);
    if (ArrayTraits<Float>::any(strands > Float(0))) f = add_rows(f, model.spread, terms, spread_rows, at, channel);
    return f;
}

// The same at phi for every channel of the tables, into f[channels].
template <class Float, class Scalar, class Memory>
CUTICLE_HD void dual_scattering_around(const DualScatteringModel<Scalar, Memory> &model, const AzimuthalTerms<Float> *terms,
                                       const Float &theta_i, const Float &theta_r, const Float &phi, const Float &strands,
                                       Float *f) {
    const Bilinear<Float> at = locate(model.direct, azimuthal_inclination(model.fibre.form, theta_i, theta_r), phi);
    for (int c = 0; c < model.direct.channels; ++c) f[c] = sum_around(model, terms[c], at, c, strands);
}

}  // namespace cuticle

#endif  // CUTICLE_DUAL_SCATTERING_H
