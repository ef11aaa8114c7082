// Far-field scattering of a circular dielectric fibre: R, TT and TRT (Marschner 2003; d'Eon 2011).
//
// Differs from Marschner 2003 in: azimuthal roughness beta_N in place of caustic removal; the absorption path
// (optics.h). Differs from d'Eon 2011 in (energy_conserving only): N is taken at the viewer's inclination, as
// Chiang 2016 does, for with N at theta_d lobes of different widths do not sum to 1 (up to 25 % lost at 80°);
// and the orders past TRT are folded into TRT.
#ifndef CUTICLE_SCATTERING_MARSCHNER_H
#define CUTICLE_SCATTERING_MARSCHNER_H

#include "cuticle/scattering/azimuthal.h"
#include "cuticle/scattering/longitudinal.h"
#include "cuticle/simd/several.h"

namespace cuticle {

template <class Float> struct FibreLobes {
    Float alpha[lobe_count], beta[lobe_count];  // radians of theta_h
    Longitudinal form;
};

// A set of lobes as a bit mask: 1 R, 2 TT, 4 TRT, 8 the backscatter of surrounding strands.
enum LobeMask { mask_r = 1, mask_tt = 2, mask_trt = 4, mask_back = 8, mask_all = 15 };

// The inclination at which N is looked up.
template <class Float>
CUTICLE_HD Float azimuthal_inclination(Longitudinal form, const Float &theta_i, const Float &theta_r) {
    return form == Longitudinal::gaussian ? theta_difference(theta_i, theta_r) : theta_r;
}

// Around the fibre, for fixed inclinations, one channel of f is a sum of rows of the azimuthal tables:
// f(phi) = Σ_p weight[direct_rows][p] N_p(phi) + Σ_p weight[spread_rows][p] N^G_p(phi) + constant, and, of light through
// other strands, the parts that through_strands.h tells apart. Everything but the look-up is done once for all phi.
enum AzimuthalRows { direct_rows, spread_rows };
template <class Float> struct AzimuthalTerms {
    Float weight[2][lobe_count], constant, through[lobe_count + 2];
};
// The same for many phi.
template <class Lanes, class Float> CUTICLE_INLINE AzimuthalTerms<Lanes> azimuthal_terms(const AzimuthalTerms<Float> &one) {
    AzimuthalTerms<Lanes> all;
    all.constant = Lanes(one.constant);
    for (int rows = 0; rows < 2; ++rows)
        for (int p = 0; p < lobe_count; ++p) all.weight[rows][p] = Lanes(one.weight[rows][p]);
    for (int p = 0; p < lobe_count + 2; ++p) all.through[p] = Lanes(one.through[p]);
    return all;
}
// What was looked up for that at one phi: N_p, N^G_p and the parts' densities.
template <class Float> struct AzimuthalValues {
    Float rows[2][lobe_count], through[lobe_count + 2];
};
template <class Float> CUTICLE_INLINE AzimuthalValues<Float> no_azimuths() {
    AzimuthalValues<Float> values;
    for (int p = 0; p < lobe_count; ++p) values.rows[direct_rows][p] = values.rows[spread_rows][p] = Float(0);
    for (int p = 0; p < lobe_count + 2; ++p) values.through[p] = Float(0);
    return values;
}
template <class Float>
CUTICLE_INLINE Float azimuthal_sum(const AzimuthalTerms<Float> &terms, const AzimuthalValues<Float> &values) {
    Float f = terms.constant;
    for (int rows = 0; rows < 2; ++rows)
        for (int p = 0; p < lobe_count; ++p) f = f + terms.weight[rows][p] * values.rows[rows][p];
    for (int p = 0; p < lobe_count + 2; ++p) f = f + terms.through[p] * values.through[p];
    return f;
}

// Shifts and variances of several longitudinal parts; these at one pair of inclinations.
template <class Float, int Count> struct LongitudinalParts {
    Several<Float, Count> alpha{0}, variance{1};

    CUTICLE_HD void set(int i, const Float &shift, const Float &width) {
        alpha.set(i, shift);
        variance.set(i, width);
    }
    CUTICLE_HD Several<Float, Count> at(Longitudinal form, const Float &theta_i, const Float &theta_r) const {
        using All = Several<Float, Count>;
        return longitudinal(form, All(theta_i), All(theta_r), alpha, variance);
    }
};

// The direct rows' weights of each channel; the rest 0.
template <class Float, class Scalar>
CUTICLE_HD void marschner_terms(const FibreLobes<Scalar> &fibre, const Float &theta_i, const Float &theta_r, int lobes,
                                int channels, AzimuthalTerms<Float> *terms) {
    for (int c = 0; c < channels; ++c) {
        for (int p = 0; p < lobe_count; ++p) terms[c].weight[direct_rows][p] = terms[c].weight[spread_rows][p] = Float(0);
        for (int p = 0; p < lobe_count + 2; ++p) terms[c].through[p] = Float(0);
        terms[c].constant = Float(0);
    }
    if (!(lobes & (mask_r | mask_tt | mask_trt))) return;
    LongitudinalParts<Float, lobe_count> parts;
    for (int p = 0; p < lobe_count; ++p) parts.set(p, Float(fibre.alpha[p]), Float(fibre.beta[p] * fibre.beta[p]));
    const auto m = parts.at(fibre.form, theta_i, theta_r);
    for (int c = 0; c < channels; ++c)
        for (int p = 0; p < lobe_count; ++p)
            if (lobes & (1 << p)) terms[c].weight[direct_rows][p] = m[p];
}

// What one table has for one channel, an int or a ChannelBetween, at a place that `locate` found.
template <class Float, class Memory, class Channel>
CUTICLE_HD void look_up(const AzimuthalTable<Memory> &table, AzimuthalRows rows, const Bilinear<Float> &at,
                        const Channel &channel, AzimuthalValues<Float> &values) {
    for (int p = 0; p < lobe_count; ++p) values.rows[rows][p] = azimuthal_value<Float>(table, at, p, channel);
}

// f in 1/sr, without a cosine, at phi into f[channels], from marschner_terms.
template <class Float, class Scalar, class Memory>
CUTICLE_HD void marschner_around(const FibreLobes<Scalar> &fibre, const AzimuthalTable<Memory> &table,
                                 const AzimuthalTerms<Float> *terms, const Float &theta_i, const Float &theta_r,
                                 const Float &phi, Float *f) {
    const Bilinear<Float> at = locate(table, azimuthal_inclination(fibre.form, theta_i, theta_r), phi);
    for (int c = 0; c < table.channels; ++c) {
        AzimuthalValues<Float> values = no_azimuths<Float>();
        look_up(table, direct_rows, at, c, values);
        f[c] = azimuthal_sum(terms[c], values);
    }
}

}  // namespace cuticle

#endif  // CUTICLE_SCATTERING_MARSCHNER_H
