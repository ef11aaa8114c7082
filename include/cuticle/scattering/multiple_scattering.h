// What surrounding strands do to light: averages of a fibre's scattering over half spheres, the energy, shift and
// spread that come back from a stack of strands. Two formulations (docs/models.md derives and compares them).
#ifndef CUTICLE_SCATTERING_MULTIPLE_SCATTERING_H
#define CUTICLE_SCATTERING_MULTIPLE_SCATTERING_H

#include "cuticle/scattering/azimuthal.h"
#include "cuticle/scattering/marschner.h"

namespace cuticle {

enum class Formulation { zinke2008, exact };

// Averages for one inclination and channel. Shifts and widths are in theta_h, radians.
template <class Float> struct Averages {
    Float a_f, a_b;          // fraction of the light scattered on (|phi| > pi/2) and back
    Float alpha_f, alpha_b;  // mean shift of a forward and of a backward scattering
    Float beta_f, beta_b;    // its deviation: weighted mean of beta_p (zinke2008), or that of the whole mixture (exact)
    Float back_energy;       // A_b: what comes back from the strands behind, out of 1
    Float back_shift, back_deviation;  // Δ_b, σ_b
};
inline constexpr int average_columns = 9;

// Value, first and second derivative along one parameter.
template <class Float> struct Jet {
    Float v, d, dd;
};
template <class Float> CUTICLE_HD Jet<Float> operator+(const Jet<Float> &a, const Jet<Float> &b) {
    return {a.v + b.v, a.d + b.d, a.dd + b.dd};
}
template <class Float> CUTICLE_HD Jet<Float> operator*(const Float &s, const Jet<Float> &a) {
    return {s * a.v, s * a.d, s * a.dd};
}
template <class Float> CUTICLE_HD Jet<Float> operator*(const Jet<Float> &a, const Jet<Float> &b) {
    return {a.v * b.v, a.d * b.v + a.v * b.d, a.dd * b.v + Float(2) * a.d * b.d + a.v * b.dd};
}
template <class Float> CUTICLE_HD Jet<Float> reciprocal(const Jet<Float> &a) {
    const Float r = Float(1) / a.v;
    return {r, -a.d * r * r, (Float(2) * a.d * a.d * r - a.dd) * r * r};
}
template <class Float> CUTICLE_HD Jet<Float> sqrt(const Jet<Float> &a) {
    const Float s = math::sqrt(a.v);
    const Float d = a.d / (Float(2) * s);
    return {s, d, (a.dd - Float(2) * d * d) / (Float(2) * s)};
}

// Energy, mean and deviation of all that comes back from a half space of strands, less the single backscatter
// (which the shaded strand's own f holds). A stack of strands each passing t and returning r reflects
// R = r + t² R / (1 - r R); with t(s) = a_f exp(s alpha_f + s² beta_f²/2) and r(s) likewise, ln(R(s) - r(s)) is the
// cumulant generating function of the shift over all orders: its derivatives at s = 0 are mean and variance.
template <class Float> CUTICLE_HD void backscatter_exact(Averages<Float> &a) {
    const auto step = [](const Float &energy, const Float &mean, const Float &deviation) {
        return Jet<Float>{energy, energy * mean, energy * (deviation * deviation + mean * mean)};
    };
    const Jet<Float> t = step(a.a_f, a.alpha_f, a.beta_f), r = step(a.a_b, a.alpha_b, a.beta_b);
    const Jet<Float> one{Float(1), Float(0), Float(0)};
    const Jet<Float> b = one + r * r + Float(-1) * (t * t);
    const Jet<Float> root = sqrt(b * b + Float(-4) * (r * r));
    const Jet<Float> w = Float(2) * (r * reciprocal(b + root)) + Float(-1) * r;  // R without cancellation
    a.back_energy = w.v;
    a.back_shift = w.d / w.v;
    a.back_deviation = math::sqrt(math::max(Float(w.dd / w.v - a.back_shift * a.back_shift), Float(0)));
}

// The same as printed in Zinke et al. 2008 (A_1 + A_3, and the closed forms for mean and deviation), kept as printed
// though the sign of 2u and the units in the denominator of the deviation are wrong.
template <class Float> CUTICLE_HD void backscatter_zinke2008(Averages<Float> &a, const Float &d_b) {
    const Float f2 = a.a_f * a.a_f, b2 = a.a_b * a.a_b, q = Float(1) - f2;
    const Float bf2 = a.beta_f * a.beta_f, bb2 = a.beta_b * a.beta_b;
    a.back_energy = a.a_b * f2 / q + a.a_b * b2 * f2 / (q * q * q);
    a.back_shift =
        a.alpha_b * (Float(1) - Float(2) * b2 / (q * q)) + a.alpha_f * (Float(2) * q * q + Float(4) * f2 * b2) / (q * q * q);
    a.back_deviation = (Float(1) + d_b * f2) *
                       (math::sqrt(Float(Float(2) * bf2 + bb2)) + b2 * math::sqrt(Float(Float(2) * bf2 + Float(3) * bb2))) /
                       (Float(1) + b2 * (Float(2) * a.beta_f + Float(3) * a.beta_b));
}

// `exact` stands on the energy-conserving longitudinal function, `zinke2008` on the Gaussian, as printed. With the
// Gaussian no fibre at all has a sum of all orders: near the poles Fresnel's term is 1 and Gaussian lobes scatter more
// than they receive.
CUTICLE_HD inline Longitudinal longitudinal_of(Formulation formulation) {
    return formulation == Formulation::exact ? Longitudinal::energy_conserving : Longitudinal::gaussian;
}

// Averages at inclination theta of the viewer. `halves(theta, p)` gives the azimuthal half energies of lobe p at an
// inclination. exact: ∫ M cos = 1 and N is taken at theta, so these are the averages. zinke2008: the midpoint rule over
// the other inclination, with the cosine as printed, cos theta_d of the specular cone.
template <class Float, class Lookup>
Averages<Float> half_sphere_averages(const FibreLobes<Float> &fibre, Formulation formulation, const Float &theta,
                                     const Lookup &halves, int quadrature) {
    Float forward[lobe_count] = {}, backward[lobe_count] = {};
    for (int p = 0; p < lobe_count; ++p) {
        if (formulation == Formulation::exact) {
            const Halves<Float> own = halves(theta, p);
            forward[p] = own.forward;
            backward[p] = own.backward;
            continue;
        }
        const Float step = pi<Float> / Float(quadrature);
        for (int j = 0; j < quadrature; ++j) {
            const Float other = -half_pi<Float> + step * (Float(j) + Float(.5));
            const Float m =
                longitudinal(Longitudinal::gaussian, other, theta, fibre.alpha[p], Float(fibre.beta[p] * fibre.beta[p]));
            const Float weight = step * math::cos(other) * math::cos(theta) * m;
            const Halves<Float> h = halves(theta_difference(other, theta), p);
            forward[p] += weight * h.forward;
            backward[p] += weight * h.backward;
        }
    }
    Averages<Float> a{};
    const auto moments = [&](const Float *energy, Float &total, Float &mean, Float &deviation) {
        Float first = Float(0), second = Float(0), width = Float(0);
        total = Float(1e-30);
        for (int p = 0; p < lobe_count; ++p) {
            total += energy[p];
            first += energy[p] * fibre.alpha[p];
            width += energy[p] * fibre.beta[p];
            second += energy[p] * (fibre.beta[p] * fibre.beta[p] + fibre.alpha[p] * fibre.alpha[p]);
        }
        mean = first / total;
        deviation = formulation == Formulation::exact ? math::sqrt(Float(second / total - mean * mean)) : width / total;
    };
    moments(forward, a.a_f, a.alpha_f, a.beta_f);
    moments(backward, a.a_b, a.alpha_b, a.beta_b);
    return a;
}

}  // namespace cuticle

#endif  // CUTICLE_SCATTERING_MULTIPLE_SCATTERING_H
