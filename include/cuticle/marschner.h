// Far-field scattering of a circular dielectric fibre: R, TT and TRT (Marschner 2003; d'Eon 2011).
//
// Differs from Marschner 2003 in: azimuthal roughness beta_N in place of caustic removal; the absorption path
// (optics.h). Differs from d'Eon 2011 in (energy_conserving only): N is taken at the viewer's inclination, as
// Chiang 2016 does, for with N at theta_d lobes of different widths do not sum to 1 (up to 25 % lost at 80°);
// and the orders past TRT are folded into TRT.
#pragma once

#include "cuticle/azimuthal.h"
#include "cuticle/longitudinal.h"

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

// f in 1/sr, without a cosine, into f[channels].
template <class Float, class Scalar>
CUTICLE_HD void marschner_eval(const FibreLobes<Scalar> &fibre, const AzimuthalTable<Scalar> &table, const Float &theta_i,
                               const Float &theta_r, const Float &phi, int lobes, Float *f) {
    for (int c = 0; c < table.channels; ++c) f[c] = Float(0);
    const Bilinear<Float> at = locate(table, azimuthal_inclination(fibre.form, theta_i, theta_r), phi);
    for (int p = 0; p < lobe_count; ++p) {
        if (!(lobes & (1 << p))) continue;
        const Float m =
            longitudinal(fibre.form, theta_i, theta_r, Float(fibre.alpha[p]), Float(fibre.beta[p] * fibre.beta[p]));
        for (int c = 0; c < table.channels; ++c)
            f[c] = f[c] + m * interpolate<Float>(table.data, at, p * table.channels + c);
    }
}

}  // namespace cuticle
