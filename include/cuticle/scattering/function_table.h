// A scattering function as a table, for one that a host cannot work out itself: measured, simulated, of another program.
//
// Energy and shape are apart: ln ∫ f cos is linear between viewers of its own and, from one strand on, between strand
// counts; the shape f cos(theta_i) / ∫ f cos is linear between viewers, rows, columns and counts. Viewers lie at theta_r =
// (pi/2) sin(t), t even over ±pi/2: closer together toward the poles, where Fresnel's term turns quickly. Rows lie at
// theta_i + theta_r = sinh(s) / stretch, s even over ±reach: dense about the highlight theta_i = -theta_r, where fibres are
// sharp, so that neighbouring viewers' highlights fall together. What lies past a pole repeats the pole's value.
#ifndef CUTICLE_SCATTERING_FUNCTION_TABLE_H
#define CUTICLE_SCATTERING_FUNCTION_TABLE_H

#include "cuticle/sampler/strand_counts.h"

namespace cuticle {

template <class Scalar, class Memory = const Scalar *> struct TabulatedModel {
    Memory shape;           // [counts][viewers][rows][columns][channels]: 1/sr
    Memory log_energy;      // [counts][energies][channels]
    const Scalar *strands;  // [counts]: several begin with 0 and 1, or at 1 or more
    int counts, viewers, energies, rows, columns, channels;
    Scalar reach, stretch;  // sinh(reach) / stretch is pi
    bool even;              // columns over [0, pi], else over [-pi, pi]
};

// Eight entries and their weights, once for every channel and strand count.
template <class Float> struct Trilinear {
    typename ArrayTraits<Float>::Index first, energy;  // first value of the lowest corner, and the energy below
    int viewer_step, row_step, column_step;
    Float a, b, c, e;  // fractions towards the next viewer, row, column and energy
};

template <class Float, class Scalar, class Memory>
CUTICLE_HD Trilinear<Float> locate(const TabulatedModel<Scalar, Memory> &table, const Float &theta_i, const Float &theta_r,
                                   const Float &phi) {
    using Traits = ArrayTraits<Float>;
    using Index = typename Traits::Index;
    const auto place = [](const Float &fraction, int count, Float &t) {
        const Float x = math::clamp(Float(fraction * Float(count - 1)), Float(0), Float(count - 1));
        const Index i = math::min(Traits::to_index(x), Index(count - 2));
        t = x - Float(i);
        return i;
    };
    const Float x = (theta_i + theta_r) * Float(table.stretch), size = math::abs(x);
    const Float s = math::copysign(Float(math::log(Float(size + math::sqrt(Float(size * size + Float(1)))))), x);
    const Float wrapped = math::wrap_angle(phi), turn = Float(1 / pi<double>);
    Trilinear<Float> at;
    at.column_step = table.channels;
    at.row_step = table.columns * at.column_step;
    at.viewer_step = table.rows * at.row_step;
    const Float sine = math::clamp(Float(theta_r * Float(2 / pi<double>)), Float(-1), Float(1));
    const Float viewer_fraction = math::asin(sine) * turn + Float(.5);
    const Index viewer = place(viewer_fraction, table.viewers, at.a);
    at.energy = place(viewer_fraction, table.energies, at.e);
    const Index row = place(Float(Float(.5) + s * Float(Scalar(.5) / table.reach)), table.rows, at.b);
    const Float around = table.even ? Float(math::abs(wrapped) * turn) : Float(Float(.5) + wrapped * Float(.5) * turn);
    const Index column = place(around, table.columns, at.c);
    at.first = viewer * Index(at.viewer_step) + row * Index(at.row_step) + column * Index(at.column_step);
    return at;
}

// The shape in one strand count's table and channel.
template <class Float, class Memory, class Index>
CUTICLE_HD Float interpolate(const Memory &shape, const Trilinear<Float> &at, const Index &offset) {
    using Traits = ArrayTraits<Float>;
    const auto line = [&](int from) {
        const Float near = Traits::gather(shape, Index(at.first + offset + Index(from)));
        const Float far = Traits::gather(shape, Index(at.first + offset + Index(from + at.column_step)));
        return Float((Float(1) - at.c) * near + at.c * far);  // convex sums: rounding never makes them negative
    };
    const auto sheet = [&](int from) { return Float((Float(1) - at.b) * line(from) + at.b * line(from + at.row_step)); };
    return (Float(1) - at.a) * sheet(0) + at.a * sheet(at.viewer_step);
}

// f in 1/sr, without a cosine, into f[channels], for `strands` between the fibre and the light; a table of one count ignores
// it. Up to one strand the functions for none and for one are mixed by the share of light; past the last count light fades
// on as it did before.
template <class Float, class Scalar, class Memory>
CUTICLE_HD void tabulated_eval(const TabulatedModel<Scalar, Memory> &table, const Float &theta_i, const Float &theta_r,
                               const Float &phi, const Float &strands, Float *f) {
    using Traits = ArrayTraits<Float>;
    using Index = typename Traits::Index;
    const Trilinear<Float> at = locate(table, theta_i, theta_r, phi);
    const Float secant = Float(1) / math::cos_theta(theta_i);
    const int size = table.viewers * at.viewer_step, energies = table.energies * table.channels;
    const auto log_energy = [&](const Index &count, int channel) {
        const Index i = count * Index(energies) + at.energy * Index(table.channels) + Index(channel);
        const Float near = Traits::gather(table.log_energy, i);
        const Float far = Traits::gather(table.log_energy, Index(i + Index(table.channels)));
        return Float((Float(1) - at.e) * near + at.e * far);
    };
    if (table.counts == 1) {
        for (int c = 0; c < table.channels; ++c)
            f[c] = math::exp(log_energy(Index(0), c)) * interpolate(table.shape, at, Index(c)) * secant;
        return;
    }
    const CountInterval<Float> count = locate_count(table.strands, table.counts, strands);
    const Float s = math::max(Float((strands - count.low) / (count.high - count.low)), Float(0));
    const Float t = math::min(s, Float(1));
    const auto mixed = count.low < Float(1);
    for (int c = 0; c < table.channels; ++c) {
        const Index lower = count.row * Index(size) + Index(c), next = Index(count.row + Index(1));
        const Float low = log_energy(count.row, c), high = log_energy(next, c), faded = low + s * (high - low);
        f[c] =
            ((Float(1) - t) * math::exp(Float(select(mixed, low, faded))) * interpolate(table.shape, at, lower) +
             t * math::exp(Float(select(mixed, high, faded))) * interpolate(table.shape, at, Index(lower + Index(size)))) *
            secant;
    }
}

}  // namespace cuticle

#endif  // CUTICLE_SCATTERING_FUNCTION_TABLE_H
