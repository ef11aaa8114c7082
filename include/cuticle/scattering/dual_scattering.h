// Dual scattering (Zinke, Yuksel, Weber, Keyser 2008): f for light that reaches a strand directly or through n others.
//
// zinke2008 is the paper's. exact differs in that what comes through strands, and from those behind, is solved over all
// orders of scattering at the true angles of travel (through_strands.h), and that the strands behind may be a stack with an
// end. Between 0 and 1 strands both formulations blend the two cases, as the paper's direct fraction does.
#ifndef CUTICLE_SCATTERING_DUAL_SCATTERING_H
#define CUTICLE_SCATTERING_DUAL_SCATTERING_H

#include "cuticle/scattering/multiple_scattering.h"
#include "cuticle/scattering/through_strands.h"

namespace cuticle {

// Averages at inclinations from pole to pole: [row][Averages][channel].
template <class Memory> struct AverageTable {
    Memory data;
    int rows, channels;
};

// Rows lie evenly in s, theta = (pi/2) (1 - (1 - |s|)²) with its sign: dense toward the poles, where Fresnel's reflection
// and with it the averages change by the square root of what is left.
template <class Float> CUTICLE_INLINE Place<Float> locate_average(const Float &theta, int rows) {
    const Float left = math::max(Float(Float(1) - math::abs(theta) * Float(2 / pi<double>)), Float(0));
    const Float s = math::copysign(Float(Float(1) - math::sqrt(left)), theta);
    return locate_node(Float((s + Float(1)) * Float(.5) * Float(rows - 1)), rows);
}

template <class Scalar, class Memory = const Scalar *> struct DualScatteringModel {
    FibreLobes<Scalar> fibre;               // its form is longitudinal_of(formulation)
    AzimuthalTable<Memory> direct, spread;  // N_p and, for zinke2008, N^G_p
    AverageTable<Memory> averages;          // for zinke2008
    Formulation formulation;
    Scalar d_f, d_b;
    ThroughTable<Scalar, Memory> through;  // for exact
};

template <class Value, class Float, class Memory, class Channel>
CUTICLE_HD Averages<Value> averages_at(const AverageTable<Memory> &table, const Float &theta, const Channel &channel) {
    using Index = typename ArrayTraits<Float>::Index;
    const Place<Float> row = locate_average(theta, table.rows);
    const Index first = Index(0);
    const int one = table.channels, size = average_columns * one;
    return {between_rows<Value>(table.data, first, row, size, 0, channel),
            between_rows<Value>(table.data, first, row, size, one, channel),
            between_rows<Value>(table.data, first, row, size, 2 * one, channel),
            between_rows<Value>(table.data, first, row, size, 3 * one, channel),
            between_rows<Value>(table.data, first, row, size, 4 * one, channel),
            between_rows<Value>(table.data, first, row, size, 5 * one, channel),
            between_rows<Value>(table.data, first, row, size, 6 * one, channel),
            between_rows<Value>(table.data, first, row, size, 7 * one, channel),
            between_rows<Value>(table.data, first, row, size, 8 * one, channel)};
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

// The share of light that no other strand met.
template <class Float> CUTICLE_HD Float direct_share(const Surroundings<Float> &around) {
    const Float n = math::max(around.strands, Float(0));
    return around.random ? Float(math::decay(Float(-n))) : Float(math::clamp(Float(Float(1) - n), Float(0), Float(1)));
}

// The paper's: what is left of the other light where each strand passes `a_f` on, and how often it was scattered. A Poisson
// number N of mean τ: E[a^N g(N)] = exp(τ (a - 1)) E[g(N')], N' Poisson's of mean τ a; `count` is the mean of N' >= 1.
template <class Float> struct Arrival {
    Float through, count;
};
template <class Value, class Float>
CUTICLE_HD Arrival<Value> arrival(const Surroundings<Float> &around, const Float &lit, const Value &a_f) {
    const Float n = math::max(around.strands, Float(0));
    if (around.random) {
        const Value mean = n * a_f, none = math::decay(Value(-mean));
        const Value through = math::max(Value(math::decay(Value(mean - n)) - lit), Value(0));
        return {through, select(mean < Value(.02), Value(Value(1) + mean * Float(.5)),
                                Value(mean / math::max(Value(Value(1) - none), Value(.01))))};
    }
    const Float count = math::max(n, Float(1));
    const Value left = math::decay(Value(count * math::log(math::max(a_f, Value(smallest<Float>)))));
    return {(Float(1) - lit) * left, Value(count)};
}

// The paper's: what f takes from light among others, in one channel: f = Σ_p lit M(α_p, β_p²) N_p
// + share M(α_p, β_p² + spread) N^G_p + lit back M(back_shift, back_variance)
// + share spread_back M(back_shift, back_variance + spread), where M = g(theta_h)/cos² theta_d.
template <class Float> struct Among {
    Float lit, share, spread;
    Float back, spread_back, back_shift, back_variance;
};
template <class Value, class Float>
CUTICLE_INLINE Among<Value> among_others(const Averages<Value> &a, const Surroundings<Float> &around, const Float &d_f,
                                         const Float &d_b) {
    const Float lit = direct_share(around), density = d_f * d_f;  // printed twice: T_f holds one
    const Value back = Float(2 / pi<double>) * d_b * a.back_energy;
    const Arrival<Value> light = arrival(around, lit, a.a_f);
    return {Value(lit),
            density * light.through,
            light.count * a.beta_f * a.beta_f,
            back,
            Float(pi<double>) * back,
            a.back_shift,
            a.back_deviation * a.back_deviation};
}

// Strands that exact looks up: a count below 1 is a share of light that met one.
template <class Float> CUTICLE_INLINE Float strands_met(const Surroundings<Float> &around) {
    return around.random ? Float(math::max(around.strands, Float(0))) : Float(math::max(around.strands, Float(1)));
}

// What the parts of exact are multiplied by: those of light that other strands scattered, and the backscatter of it and of
// direct light.
template <class Float> struct Shares {
    Float lit, scattered, back, direct_back;
};
template <class Value, class Float>
CUTICLE_INLINE Shares<Value> shares(const Behind<Value> &end, const Surroundings<Float> &around, const Float &d_f,
                                    const Float &d_b) {
    const Float b = math::max(around.behind, Float(0)), lit = direct_share(around);
    const Float other = d_f * math::max(Float(Float(1) - lit), Float(0)), back = d_b * other, direct_back = d_b * lit;
    const Value none = math::decay(Value(-end.scattered * b)), direct = math::decay(Value(-end.direct * b));
    return {Value(lit), other * (Value(1) - (Value(1) - end.alone) * none),
            back * math::max(Value(Value(1) - none), Value(0)), direct_back * math::max(Value(Value(1) - direct), Value(0))};
}

// The parts of through_lobes times their shares; those left out of `lobes` (LobeMask) are 0.
template <class Float> CUTICLE_INLINE void shared(const Shares<Float> &share, int lobes, Float *parts) {
    for (int p = 0; p < lobe_count; ++p) parts[p] = lobes & (1 << p) ? Float(share.scattered * parts[p]) : Float(0);
    parts[lobe_count] = share.back * parts[lobe_count];
    parts[through_parts] = share.direct_back * parts[through_parts];
}

template <class Float, class Scalar, class Memory>
CUTICLE_INLINE ThroughPlace<Float> place_among(const ThroughTable<Scalar, Memory> &table, const Float &theta_r,
                                               const Surroundings<Float> &around) {
    return locate(table, theta_r, strands_met(around), around.random, around.random || any_above(around.strands, Float(0)));
}

// Turns the direct rows' weights of marschner_terms into what f is around the fibre among others, in one channel: an int or
// a ChannelBetween.
template <class Float, class Scalar, class Memory, class Channel>
CUTICLE_HD void add_surroundings(const DualScatteringModel<Scalar, Memory> &model, const Channel &channel,
                                 const Float &theta_i, const Float &theta_r, const Surroundings<Float> &around, int lobes,
                                 AzimuthalTerms<Float> &t) {
    using Traits = ArrayTraits<Float>;
    const Longitudinal form = model.fibre.form;
    const Float d_f = Float(model.d_f), d_b = Float(lobes & mask_back ? model.d_b : Scalar(0));
    if (model.formulation == Formulation::exact) {
        const ThroughPlace<Float> place = place_among(model.through, theta_r, around);
        const Shares<Float> share =
            shares(behind_at<Float>(model.through.behind, place.row, model.through.channels, channel), around, d_f, d_b);
        through_lobes(through_moments(model.through, place, channel), theta_i, t.through);
        for (int p = 0; p < lobe_count; ++p) t.weight[direct_rows][p] = share.lit * t.weight[direct_rows][p];
        shared(share, lobes, t.through);
        return;
    }
    const Averages<Float> a = averages_at<Float>(model.averages, azimuthal_inclination(form, theta_i, theta_r), channel);
    const Among<Float> light = among_others(a, around, d_f, d_b);
    for (int p = 0; p < lobe_count; ++p) t.weight[direct_rows][p] = light.lit * t.weight[direct_rows][p];
    if (!Traits::any(light.lit < Float(1))) {
        t.constant = light.back * longitudinal(form, theta_i, theta_r, light.back_shift, light.back_variance);
        return;
    }
    LongitudinalParts<Float, lobe_count + 2> parts;
    for (int p = 0; p < lobe_count; ++p)
        parts.set(p, Float(model.fibre.alpha[p]), Float(Float(model.fibre.beta[p] * model.fibre.beta[p]) + light.spread));
    parts.set(lobe_count, light.back_shift, Float(light.back_variance + light.spread));
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

// What the terms of one channel are multiplied by at phi; `at` is the place that `locate` found in model.direct, and the
// spread table has the same rows and columns.
template <class Float, class Scalar, class Memory, class Channel>
CUTICLE_HD AzimuthalValues<Float> azimuths_around(const DualScatteringModel<Scalar, Memory> &model,
                                                  const Bilinear<Float> &at, const Float &theta_r, const Float &phi,
                                                  const Channel &channel, const Surroundings<Float> &around) {
    using Traits = ArrayTraits<Float>;
    AzimuthalValues<Float> values = no_azimuths<Float>();
    if (around.random || Traits::any(around.strands < Float(1))) look_up(model.direct, direct_rows, at, channel, values);
    if (model.formulation == Formulation::exact)
        through_azimuths(model.through, place_among(model.through, theta_r, around), phi, channel, values.through);
    else if (Traits::any(around.strands > Float(0))) look_up(model.spread, spread_rows, at, channel, values);
    return values;
}

// f of one channel in 1/sr, without a cosine, at phi from its terms.
template <class Float, class Scalar, class Memory, class Channel>
CUTICLE_HD Float sum_around(const DualScatteringModel<Scalar, Memory> &model, const AzimuthalTerms<Float> &terms,
                            const Bilinear<Float> &at, const Float &theta_r, const Float &phi, const Channel &channel,
                            const Surroundings<Float> &around) {
    return azimuthal_sum(terms, azimuths_around(model, at, theta_r, phi, channel, around));
}

// The same at phi for every channel of the tables, into f[channels].
template <class Float, class Scalar, class Memory>
CUTICLE_HD void dual_scattering_around(const DualScatteringModel<Scalar, Memory> &model, const AzimuthalTerms<Float> *terms,
                                       const Float &theta_i, const Float &theta_r, const Float &phi,
                                       const Surroundings<Float> &around, Float *f) {
    const Bilinear<Float> at = locate(model.direct, azimuthal_inclination(model.fibre.form, theta_i, theta_r), phi);
    for (int c = 0; c < model.direct.channels; ++c) f[c] = sum_around(model, terms[c], at, theta_r, phi, c, around);
}

}  // namespace cuticle

#endif  // CUTICLE_SCATTERING_DUAL_SCATTERING_H
