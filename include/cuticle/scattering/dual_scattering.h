// Dual scattering (Zinke, Yuksel, Weber, Keyser 2008): f for light that reaches a strand directly or through n others.
//
// Differs from the paper in (exact only): the backscatter sums all orders, and so does what comes through; the strands
// behind may be a stack with an end; every part is normalised to the energy it stands for; forward scattering shifts light
// as well as spreading it; no factor pi before the backscatter of spread light. Between 0 and 1 strands both formulations
// blend the two cases, as the paper's direct fraction does.
#ifndef CUTICLE_SCATTERING_DUAL_SCATTERING_H
#define CUTICLE_SCATTERING_DUAL_SCATTERING_H

#include "cuticle/scattering/multiple_scattering.h"

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

// How many others stand around a strand.
template <class Float> struct Surroundings {
    Float strands;  // between it and the light: n >= 0, whole or not; or, if `random`, what is expected of a Poisson number
    Float behind;   // beyond it, away from the light, expected of a Poisson number; `half_space`: no end of them
    bool random;
};
template <class Float> inline constexpr scalar_t<Float> half_space = largest<Float>;

// n strands between a strand and the light, and no end of them behind it: the paper's case.
template <class Float> CUTICLE_HD Surroundings<Float> counted(const Float &strands) {
    return {strands, Float(half_space<Float>), false};
}

// What has come to a strand when it is shaded: the share of light that no other strand met; what is left of the rest where
// each passes `a_f` on; how often the rest was scattered, its mean and, where the number is random, its variance.
template <class Float> struct Arrival {
    Float lit, through, count, variance;
};

// A Poisson number N of mean τ: E[a^N g(N)] = exp(τ (a - 1)) E[g(N')], N' Poisson's of mean τ a; `count` and `variance` are
// those of N' >= 1.
template <class Float> CUTICLE_HD Arrival<Float> arrival(const Surroundings<Float> &around, const Float &a_f) {
    const Float n = around.strands;
    if (around.random) {
        const Float lit = math::decay(Float(-n)), mean = n * a_f, none = math::decay(Float(-mean));
        const Float through = math::max(Float(math::decay(Float(mean - n)) - lit), Float(0));
        const auto few = mean < Float(.02);
        const Float count =
            select(few, Float(Float(1) + mean * Float(.5)), Float(mean / math::max(Float(1) - none, Float(.01))));
        return {lit, through, count, math::max(Float(count * (Float(1) + mean - count)), Float(0))};
    }
    const Float lit = math::max(Float(Float(1) - n), Float(0)), count = math::max(n, Float(1));
    const Float left = math::decay(Float(count * math::log(math::max(a_f, Float(smallest<Float>)))));
    return {lit, (Float(1) - lit) * left, count, Float(0)};
}

// Turns the direct rows' weights of marschner_terms into what f is around the fibre among others, in one channel: an int or
// a ChannelBetween. The backscatter does not depend on phi; with `exact` its ∫ f cos over the back half is A_b, and
// zinke2008's is as printed, 2 A_b g / (pi cos² theta_d).
template <class Float, class Scalar, class Memory, class Channel>
CUTICLE_HD void add_surroundings(const DualScatteringModel<Scalar, Memory> &model, const Channel &channel,
                                 const Float &theta_i, const Float &theta_r, const Surroundings<Float> &around, int lobes,
                                 AzimuthalTerms<Float> &t) {
    using Traits = ArrayTraits<Float>;
    const bool exact = model.formulation == Formulation::exact;
    const Longitudinal form = model.fibre.form;
    // `exact` takes every average at the viewer's inclination, so that each part's energy is known in closed form.
    const Averages<Float> a =
        averages_at(model.averages, azimuthal_inclination(form, theta_i, theta_r), channel, model.direct.channels);
    const Stack<Float> others = stack(a, around.behind);
    Arrival<Float> light = arrival(around, exact ? others.pass : a.a_f);
    if (exact) light.through = light.through * others.reach(light.count);
    const Float back_variance = a.back_deviation * a.back_deviation;
    const Float energy = a.back_energy * (exact ? others.back : Float(2));
    const Float back = Float(lobes & mask_back ? model.d_b : Scalar(0)) * energy * Float(1 / pi<double>);
    for (int p = 0; p < lobe_count; ++p) t.weight[direct_rows][p] = light.lit * t.weight[direct_rows][p];
    if (!Traits::any(light.lit < Float(1))) {
        t.constant = back * longitudinal(form, theta_i, theta_r, a.back_shift, back_variance);
        return;
    }
    const Float spread =
        light.count * a.beta_f * a.beta_f + (exact ? Float(light.variance * a.alpha_f * a.alpha_f) : Float(0));
    const Float shift = exact ? Float(light.count * a.alpha_f) : Float(0);
    const Float density = Float(model.d_f) * (exact ? Float(1) : Float(model.d_f));  // printed twice: T_f holds one
    const Float share = density * light.through;
    LongitudinalParts<Float, lobe_count + 2> parts;
    for (int p = 0; p < lobe_count; ++p)
        parts.set(p, Float(Float(model.fibre.alpha[p]) + shift),
                  Float(Float(model.fibre.beta[p] * model.fibre.beta[p]) + spread));
    parts.set(lobe_count, Float(a.back_shift + shift), Float(back_variance + spread));
    parts.set(lobe_count + 1, a.back_shift, back_variance);
    const auto m = parts.at(form, theta_i, theta_r);
    for (int p = 0; p < lobe_count; ++p)
        if (lobes & (1 << p)) t.weight[spread_rows][p] = share * m[p];
    t.constant = back * (light.lit * m[lobe_count + 1] + share * Float(exact ? 1. : pi<double>) * m[lobe_count]);
}

// The same for every channel of the tables: terms[channels].
template <class Float, class Scalar, class Memory>
CUTICLE_HD void dual_scattering_terms(const DualScatteringModel<Scalar, Memory> &model, const Float &theta_i,
                                      const Float &theta_r, const Surroundings<Float> &around, int lobes,
                                      AzimuthalTerms<Float> *terms) {
    const int channels = model.direct.channels;
    const bool some_lit = around.random || ArrayTraits<Float>::any(around.strands < Float(1));
    marschner_terms(model.fibre, theta_i, theta_r, some_lit ? lobes : 0, channels, terms);
    for (int c = 0; c < channels; ++c) add_surroundings(model, c, theta_i, theta_r, around, lobes, terms[c]);
}

// f of one channel in 1/sr, without a cosine, from its terms, at a place that `locate` found in model.direct; the spread
// table has the same rows and columns.
template <class Float, class Scalar, class Memory, class Channel>
CUTICLE_HD Float sum_around(const DualScatteringModel<Scalar, Memory> &model, const AzimuthalTerms<Float> &terms,
                            const Bilinear<Float> &at, const Channel &channel, const Surroundings<Float> &around) {
    using Traits = ArrayTraits<Float>;
    Float f = terms.constant;
    if (around.random || Traits::any(around.strands < Float(1)))
        f = add_rows(f, model.direct, terms, direct_rows, at, channel);
    if (Traits::any(around.strands > Float(0))) f = add_rows(f, model.spread, terms, spread_rows, at, channel);
    return f;
}

// The same at phi for every channel of the tables, into f[channels].
template <class Float, class Scalar, class Memory>
CUTICLE_HD void dual_scattering_around(const DualScatteringModel<Scalar, Memory> &model, const AzimuthalTerms<Float> *terms,
                                       const Float &theta_i, const Float &theta_r, const Float &phi,
                                       const Surroundings<Float> &around, Float *f) {
    const Bilinear<Float> at = locate(model.direct, azimuthal_inclination(model.fibre.form, theta_i, theta_r), phi);
    for (int c = 0; c < model.direct.channels; ++c) f[c] = sum_around(model, terms[c], at, c, around);
}

}  // namespace cuticle

#endif  // CUTICLE_SCATTERING_DUAL_SCATTERING_H
