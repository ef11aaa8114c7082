// The cells into which far_field.h cuts a fibre's half width, and the azimuthal distribution D that smooths their light.
#ifndef CUTICLE_SCATTERING_FAR_CELLS_H
#define CUTICLE_SCATTERING_FAR_CELLS_H

#include "cuticle/math/erf.h"
#include "cuticle/math/logistic.h"
#include "cuticle/scattering/azimuthal.h"
#include "cuticle/simd/abreast.h"

namespace cuticle {

// Cells of R, TT and TRT, one after the other; a lobe's edges are one more than its cells. TRT takes every third edge of TT.
inline constexpr int r_cells = 24;
inline constexpr int tt_cells = r_cells;  // CellGeometry serves both
inline constexpr int tt_in_trt = 3;
inline constexpr int first_tt = r_cells;
inline constexpr int first_trt = r_cells + tt_cells;
inline constexpr int far_cells = first_trt + tt_cells / tt_in_trt;
inline constexpr int far_edges = 64;  // of them far_cells + lobe_count are used
CUTICLE_HD constexpr int first_cell(int p) { return p == 0 ? 0 : p == 1 ? first_tt : p == 2 ? first_trt : far_cells; }

// Distances times unit_rate are those of a D of unit width; lower_tail is the probability that such a one leaves for less
// than -x, x >= 0.
template <class Float> CUTICLE_INLINE Float unit_rate(Azimuthal form, const Float &width) {
    return Float(form == Azimuthal::logistic ? Float(1) : Float(sqrt_half<Float>)) / width;
}
template <class Float> CUTICLE_INLINE Float lower_tail(Azimuthal form, const Float &x) {
    if (form == Azimuthal::logistic) return logistic_lower(Float(-x), Float(1));
    return Float(.5) * math::erfc_positive(x);
}

// D truncated to ±pi: the inverse of its cdf.
template <class Float> CUTICLE_HD Float turn_of(Azimuthal form, const Float &u, const Float &width) {
    if (form == Azimuthal::logistic) return trimmed_logistic_inverse(u, width);
    const Float rate = unit_rate(form, width), cut = lower_tail(form, Float(Float(pi<Float>) * rate));
    const Float side = math::min(u, Float(Float(1) - u));
    const Float twice = Float(2) * math::max(Float(side * (Float(1) - Float(2) * cut) + cut), Float(smallest<Float>));
    const Float z = select(twice < Float(.0034), math::erfcinv_small(math::min(twice, Float(.0034))),
                           math::erfinv(Float(Float(1) - math::max(twice, Float(.0034)))));
    const Float x = math::max(Float(-z / rate), Float(-pi<Float>));
    return math::copysign(math::min(x, Float(0)), Float(u - Float(.5)));
}

// D's cdf at x in [-2 pi, 2 pi], continued around the circle, as a whole number and a rest: where two are on one side of D,
// the whole numbers cancel and their difference keeps its digits. `rate` and `cut` as of `unit_rate` and at pi.
template <class Float> struct Turned {
    Float whole, rest;
};
template <class Float>
CUTICLE_INLINE Turned<Float> turned(Azimuthal form, const Float &x, const Float &rate, const Float &cut, const Float &kept) {
    const Float size = math::abs(x), way = math::min(size, Float(Float(2 * pi<double>) - size));
    const Float tail = (lower_tail(form, math::max(way, Float(0)) * rate) - cut) * kept;
    const Float ahead = select(size > Float(pi<Float>), tail, Float(-tail));  // for x > 0; behind it is the other
    return {select(x > Float(0), Float(1), Float(0)), select(x > Float(0), ahead, Float(-ahead))};
}

// Offsets h = sin(gamma) at which cells begin. R: gamma = pi/2 (1 - (1 - j / r_cells)²), dense where Fresnel's term is
// steep; TT: even in gamma. What does not depend on the fibre is computed once, by the compiler.
template <class Scalar> struct CellGeometry {
    Scalar gamma[tt_cells + 8], sine[tt_cells + 8];         // at edges
    Scalar middle_sine[tt_cells], middle_cosine[tt_cells];  // at the middles in gamma
    Scalar width[tt_cells];                                 // in h
};
CUTICLE_HD constexpr double series_cosine(double x) {  // of |x| <= pi/2
    double term = 1, total = 1;
    for (int k = 1; k < 14; ++k) total += term *= -x * x / ((2 * k - 1) * (2 * k));
    return total;
}
CUTICLE_HD constexpr double gamma_edge(int j, bool dense) {
    const double left = 1 - double(j) / tt_cells;
    return pi<double> / 2 * (1 - (dense ? left * left : left));
}
template <class Scalar> CUTICLE_HD constexpr CellGeometry<Scalar> cell_geometry(bool dense) {
    CellGeometry<Scalar> g{};
    for (int j = 0; j <= tt_cells; ++j) {
        g.gamma[j] = Scalar(gamma_edge(j, dense));
        g.sine[j] = Scalar(series_cosine(pi<double> / 2 - gamma_edge(j, dense)));
    }
    for (int j = 0; j < tt_cells; ++j) {
        const double from = gamma_edge(j, dense), to = gamma_edge(j + 1, dense), middle = .5 * (from + to);
        g.middle_cosine[j] = Scalar(series_cosine(middle));
        g.middle_sine[j] = Scalar(series_cosine(pi<double> / 2 - middle));
        g.width[j] = Scalar(2 * series_cosine(middle) * series_cosine((pi<double> - (to - from)) / 2));
    }
    return g;
}

// Of cells side by side, from the j-th on; `dense` for R. Shaders fetch them from tables of their own.
template <class Float> struct CellEdges {
    Float gamma, sine;
};
template <class Float> struct CellMiddles {
    Float sine, cosine, width;
};
template <class Float> CUTICLE_INLINE CellEdges<Abreast<Float>> cell_edges(bool dense, int j) {
    CUTICLE_CONSTANTS CellGeometry<scalar_t<Float>> fine = cell_geometry<scalar_t<Float>>(true),
                                                    even = cell_geometry<scalar_t<Float>>(false);
    const CellGeometry<scalar_t<Float>> &g = dense ? fine : even;
    return {constants_abreast<Float>(g.gamma, j), constants_abreast<Float>(g.sine, j)};
}
template <class Float> CUTICLE_INLINE CellMiddles<Abreast<Float>> cell_middles(bool dense, int j) {
    CUTICLE_CONSTANTS CellGeometry<scalar_t<Float>> fine = cell_geometry<scalar_t<Float>>(true),
                                                    even = cell_geometry<scalar_t<Float>>(false);
    const CellGeometry<scalar_t<Float>> &g = dense ? fine : even;
    return {constants_abreast<Float>(g.middle_sine, j), constants_abreast<Float>(g.middle_cosine, j),
            constants_abreast<Float>(g.width, j)};
}

}  // namespace cuticle

#endif  // CUTICLE_SCATTERING_FAR_CELLS_H
