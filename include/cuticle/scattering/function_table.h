// A scattering function as a table, for functions that a host cannot compute: measured, simulated, from another program.
//
// Energy and shape are stored apart. ln ∫ f cos is linear between viewers, of which it has its own, and from one strand on
// between strand counts. The shape f cos(theta_i) / ∫ f cos is linear between viewers, rows, columns and counts.
// Viewers lie at theta_r = (pi/2) sin(t), t evenly spaced over ±pi/2: denser toward the poles, where Fresnel reflection
// changes quickly. Rows lie at theta_i + theta_r = sinh(s) / stretch, s evenly spaced over ±reach: dense around the
// highlight theta_i = -theta_r, where fibres are sharp, so that the highlights of neighbouring viewers coincide. Past a
// pole, the pole's value is repeated.
#ifndef CUTICLE_SCATTERING_FUNCTION_TABLE_H
#define CUTICLE_SCATTERING_FUNCTION_TABLE_H

#include "cuticle/sampler/strand_counts.h"

namespace cuticle {

template <class Scalar, class Memory = const Scalar *> struct TabulatedModel {
    Memory shape;           // [counts][viewers][rows][columns][channels]: 1/sr
    Memory log_energy;      // [counts][energies][channels]
    const Scalar *strands;  // [counts]: if several, from 0 and 1 on, or from 1 or more
    int counts, viewers, energies, rows, columns, channels;
    Scalar reach, stretch;  // sinh(reach) / stretch is pi
    bool even;              // columns over [0, pi], else over [-pi, pi]
};

// Eight entries and their weights, found once for all channels and strand counts.
template <class Float> struct Trilinear {
    typename ArrayTraits<Float>::Index first, energy;  // first value of the lowest corner, and the energy below
    int viewer_step, row_step, column_step;
    Float a, b, c, e;  // fractions towards the next viewer, row, column and energy
};

// Positions from 0 to 1 along viewers (and energies), rows and columns; `share` is ½ / reach.
template <class Float> CUTICLE_INLINE Float viewer_fraction(const Float &theta_r) {
    const Float sine = math::clamp(Float(theta_r * Float(2 / pi<double>)), Float(-1), Float(1));
    return math::asin(sine) * Float(1 / pi<double>) + Float(.5);
}
template <class Float>
CUTICLE_INLINE Float row_fraction(const Float &theta_i, const Float &theta_r, const Float &stretch, const Float &share) {
    const Float x = (theta_i + theta_r) * stretch, size = math::abs(x);
    const Float s = math::log(Float(size + math::sqrt(Float(size * size + Float(1)))));
    return Float(.5) + math::copysign(s, x) * share;
}
template <class Float> CUTICLE_INLINE Float column_fraction(const Float &phi, bool even) {
    const Float wrapped = math::wrap_angle(phi), turn = Float(1 / pi<double>);
    return even ? Float(math::abs(wrapped) * turn) : Float(Float(.5) + wrapped * Float(.5) * turn);
}
template <class Float> CUTICLE_INLINE Place<Float> locate_fraction(const Float &fraction, int count) {
    return locate_node(Float(fraction * Float(count - 1)), count);
}

template <class Float, class Scalar, class Memory>
CUTICLE_HD Trilinear<Float> locate(const TabulatedModel<Scalar, Memory> &table, const Float &theta_i, const Float &theta_r,
                                   const Float &phi) {
    using Index = typename ArrayTraits<Float>::Index;
    const Float fraction = viewer_fraction(theta_r), share = Float(Scalar(.5) / table.reach);
    const Place<Float> viewer = locate_fraction(fraction, table.viewers), energy = locate_fraction(fraction, table.energies);
    const Place<Float> row = locate_fraction(row_fraction(theta_i, theta_r, Float(table.stretch), share), table.rows);
    const Place<Float> column = locate_fraction(column_fraction(phi, table.even), table.columns);
    Trilinear<Float> at;
    at.column_step = table.channels;
    at.row_step = table.columns * at.column_step;
    at.viewer_step = table.rows * at.row_step;
    at.first = viewer.node * Index(at.viewer_step) + row.node * Index(at.row_step) + column.node * Index(at.column_step);
    at.energy = energy.node;
    at.a = viewer.t, at.b = row.t, at.c = column.t, at.e = energy.t;
    return at;
}

// The shape in one strand count's table and channel.
template <class Float, class Memory, class Index>
CUTICLE_HD Float interpolate(const Memory &shape, const Trilinear<Float> &at, const Index &offset) {
    const auto value = [&](int from) {
        return Float(ArrayTraits<Float>::gather(shape, Index(at.first + offset + Index(from))));
    };
    const auto sheet = [&](int from) {
        const int next = from + at.row_step;
        return math::bilinear(value(from), value(from + at.column_step), value(next), value(next + at.column_step), at.b,
                              at.c);
    };
    return math::convex(sheet(0), sheet(at.viewer_step), at.a);
}

// The factors of the shapes at two counts, given the logs of their energies. Up to one strand, the functions for none and
// for one are mixed by their shares of the light. From one strand on, light decays by a constant factor per strand, past
// the last count as well.
template <class Value> struct CountWeights {
    Value lower, upper;
};
template <class Value, class Float>
CUTICLE_INLINE CountWeights<Value> count_weights(const Value &low, const Value &high, const CountInterval<Float> &count,
                                                 const Float &strands) {
    const Float s = math::max(Float((strands - count.low) / (count.high - count.low)), Float(0)), t = math::min(s, Float(1));
    const Value faded = math::linear(low, high, s);
    const Value lower = select(count.low < Float(1), low, faded), upper = select(count.low < Float(1), high, faded);
    return {(Float(1) - t) * math::exp(lower), t * math::exp(upper)};
}

// f in 1/sr, without a cosine, into f[channels], for `strands` between the fibre and the light; a table of one count ignores
// it.
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
        return math::convex(near, far, at.e);
    };
    if (table.counts == 1) {
        for (int c = 0; c < table.channels; ++c)
            f[c] = math::exp(log_energy(Index(0), c)) * interpolate(table.shape, at, Index(c)) * secant;
        return;
    }
    const CountInterval<Float> count = locate_count(table.strands, table.counts, strands);
    for (int c = 0; c < table.channels; ++c) {
        const Index lower = count.row * Index(size) + Index(c), next = Index(count.row + Index(1));
        const CountWeights<Float> w = count_weights(log_energy(count.row, c), log_energy(next, c), count, strands);
        f[c] = (w.lower * interpolate(table.shape, at, lower) +
                w.upper * interpolate(table.shape, at, Index(lower + Index(size)))) *
               secant;
    }
}

}  // namespace cuticle

#endif  // CUTICLE_SCATTERING_FUNCTION_TABLE_H
