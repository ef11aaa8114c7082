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

#include "cuticle/math/table_values.h"
#include "cuticle/sampler/strand_counts.h"

namespace cuticle {

template <class Scalar, class Memory = const Scalar *> struct TabulatedModel {
    Memory shape;       // [counts][viewers][rows][columns][channels]: 1/sr
    Memory log_energy;  // [counts][energies][channels]
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
    const int column_step = table.channels, row_step = table.columns * column_step, viewer_step = table.rows * row_step;
    return {viewer.node * Index(viewer_step) + row.node * Index(row_step) + column.node * Index(column_step),
            energy.node,
            viewer_step,
            row_step,
            column_step,
            viewer.t,
            row.t,
            column.t,
            energy.t};
}

// The shape in one strand count's table and channel.
template <class Value, class Float, class Memory, class Index>
CUTICLE_HD Value interpolate(const Memory &shape, const Trilinear<Float> &at, const Index &offset) {
    const Index own = at.first + offset, next = own + Index(at.viewer_step);
    return math::convex(bilinear_value<Value>(shape, own, at.row_step, at.column_step, at.b, at.c, 0),
                        bilinear_value<Value>(shape, next, at.row_step, at.column_step, at.b, at.c, 0), at.a);
}
// ln of the energy of one strand count and channel.
template <class Value, class Float, class Scalar, class Memory, class Index>
CUTICLE_INLINE Value log_energy_at(const TabulatedModel<Scalar, Memory> &table, const Trilinear<Float> &at,
                                   const Index &count, int channel) {
    const Index i = (count * Index(table.energies) + at.energy) * Index(table.channels);
    return math::convex(channel_value<Value>(table.log_energy, i, channel),
                        channel_value<Value>(table.log_energy, i, channel + table.channels), at.e);
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

// f cos(theta_i) in one channel, for `strands` between the fibre and the light, which lie among the counts at `count`; a
// table of one count ignores both.
template <class Value, class Float, class Scalar, class Memory>
CUTICLE_HD Value tabulated_value(const TabulatedModel<Scalar, Memory> &table, const Trilinear<Float> &at,
                                 const CountInterval<Float> &count, const Float &strands, int channel) {
    using Index = typename ArrayTraits<Float>::Index;
    if (table.counts == 1)
        return math::exp(log_energy_at<Value>(table, at, Index(0), channel)) *
               interpolate<Value>(table.shape, at, Index(channel));
    const Index size = Index(table.viewers * at.viewer_step), lower = count.row * size + Index(channel);
    const CountWeights<Value> w =
        count_weights(log_energy_at<Value>(table, at, count.row, channel),
                      log_energy_at<Value>(table, at, Index(count.row + Index(1)), channel), count, strands);
    return w.lower * interpolate<Value>(table.shape, at, lower) +
           w.upper * interpolate<Value>(table.shape, at, Index(lower + size));
}

// f in 1/sr, without a cosine, into f[channels]; counts: of strands [table.counts], if several, from 0 and 1 on, or from 1
// or more.
template <class Float, class Scalar, class Memory>
CUTICLE_HD void tabulated_eval(const TabulatedModel<Scalar, Memory> &table, const Scalar *counts, const Float &theta_i,
                               const Float &theta_r, const Float &phi, const Float &strands, Float *f) {
    const Trilinear<Float> at = locate(table, theta_i, theta_r, phi);
    const CountInterval<Float> count = locate_count(counts, table.counts, strands);
    const Float secant = Float(1) / math::cos_theta(theta_i);
    for (int c = 0; c < table.channels; ++c) f[c] = tabulated_value<Float>(table, at, count, strands, c) * secant;
}

}  // namespace cuticle

#endif  // CUTICLE_SCATTERING_FUNCTION_TABLE_H
