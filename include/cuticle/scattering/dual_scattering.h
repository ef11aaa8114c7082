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

template <class Float> CUTICLE_INLINE Place<Float> locate_average(const Float &theta, int rows, const Float &limit) {
    return locate_node(Float((theta / limit + Float(1)) * Float(.5) * Float(rows - 1)), rows);
}

template <class Float, class Scalar, class Memory, class Channel>
CUTICLE_HD Averages<Float> averages_at(const AverageTable<Scalar, Memory> &table, const Float &theta, const Channel &channel,
                                       int channels) {
    using Traits = ArrayTraits<Float>;
    using Index = typename Traits::Index;
    const Place<Float> place = locate_average(theta, table.rows, Float(table.limit));
    const Index first = (place.node * Index(channels) + Index(channel)) * Index(average_columns);
    const auto at = [&](int column) {
        const Float lower = Traits::gather(table.data, Index(first + Index(column)));
        const Float upper = Traits::gather(table.data, Index(first + Index(column + channels * average_columns)));
        return math::linear(lower, upper, place.t);
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
    const Float n = math::max(around.strands, Float(0));
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

// What f takes from light among others, in one channel: f = Σ_p lit M(α_p, β_p²) N_p + share M(α_p + shift, β_p² + spread)
// N^G_p
// + lit back M(back_shift, back_variance) + share spread_back M(back_shift + shift, back_variance + spread). The backscatter
// does not depend on phi; with `exact` its ∫ f cos over the back half is A_b, and zinke2008's is as printed,
// 2 A_b g / (pi cos² theta_d).
template <class Float> struct Among {
    Float lit, share, shift, spread;
    Float back, spread_back, back_shift, back_variance;
};

template <class Float>
CUTICLE_INLINE Among<Float> among_others(Formulation formulation, const Averages<Float> &a,
                                         const Surroundings<Float> &around, const Float &d_f, const Float &d_b) {
    const bool exact = formulation == Formulation::exact;
    const Stack<Float> others = stack(a, around.behind);
    const Arrival<Float> light = arrival(around, exact ? others.pass : a.a_f);
    const Float through = exact ? Float(light.through * reach(others, light.count)) : light.through;
    const Float energy = a.back_energy * (exact ? others.back : Float(2));
    const Float back = d_b * energy * Float(1 / pi<double>);
    const Float widened = light.count * a.beta_f * a.beta_f;
    const Float spread = exact ? Float(widened + light.variance * a.alpha_f * a.alpha_f) : widened;
    const Float shift = exact ? Float(light.count * a.alpha_f) : Float(0);
    const Float density = exact ? d_f : Float(d_f * d_f);  // printed twice: T_f holds one
    const Float spread_back = exact ? back : Float(back * Float(pi<double>));
    return {light.lit, density * through, shift,        spread,
            back,      spread_back,       a.back_shift, a.back_deviation * a.back_deviation};
}

// Turns the direct rows' weights of marschner_terms into what f is around the fibre among others, in one channel: an int or
// a ChannelBetween.
template <class Float, class Scalar, class Memory, class Channel>
CUTICLE_HD void add_surroundings(const DualScatteringModel<Scalar, Memory> &model, const Channel &channel,
                                 const Float &theta_i, const Float &theta_r, const Surroundings<Float> &around, int lobes,
                                 AzimuthalTerms<Float> &t) {
    using Traits = ArrayTraits<Float>;
    const Longitudinal form = model.fibre.form;
    // `exact` takes every average at the viewer's inclination, so that each part's energy is known in closed form.
    const Averages<Float> a =
        averages_at(model.averages, azimuthal_inclination(form, theta_i, theta_r), channel, model.direct.channels);
    const Float d_b = Float(lobes & mask_back ? model.d_b : Scalar(0));
    const Among<Float> light = among_others(model.formulation, a, around, Float(model.d_f), d_b);
    for (int p = 0; p < lobe_count; ++p) t.weight[direct_rows][p] = light.lit * t.weight[direct_rows][p];
    if (!Traits::any(light.lit < Float(1))) {
        t.constant = light.back * longitudinal(form, theta_i, theta_r, light.back_shift, light.back_variance);
        return;
    }
    LongitudinalParts<Float, lobe_count + 2> parts;
    for (int p = 0; p < lobe_count; ++p)
        parts.set(p, Float(Float(model.fibre.alpha[p]) + light.shift),
                  Float(Float(model.fibre.beta[p] * model.fibre.beta[p]) + light.spread));
    parts.set(lobe_count, Float(light.back_shift + light.shift), Float(light.back_variance + light.spread));
    parts.set(lobe_count + 1, light.back_shift, light.back_variance);
    const auto m = parts.at(form, theta_i, theta_r);
    for (int p = 0; p < lobe_count; ++p)
        if (lobes & (1 << p)) t.weight[spread_rows][p] = light.share * m[p];
    t.constant = light.back * light.lit * m[lobe_count + 1] + light.spread_back * light.share * m[lobe_count];
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
