// The azimuthal functions N_p(theta_d, phi), by quadrature over the offset h, one table row per theta_d.
//
// N_p(phi) = ½ ∫ A(p, h) D(phi - phi_p(h)) dh, where D is a wrapped normal of deviation beta_N (d'Eon 2011) or a logistic
// distribution truncated to ±pi (Chiang 2016). Each cell of h spreads its energy evenly over the azimuths between its
// edges, which is exact where phi_p(h) is linear and does not alias as beta_N -> 0. Smoothing by D is one convolution of
// the row.
#ifndef CUTICLE_SCATTERING_AZIMUTHAL_H
#define CUTICLE_SCATTERING_AZIMUTHAL_H

#include "cuticle/math/logistic.h"
#include "cuticle/math/table_values.h"
#include "cuticle/scattering/longitudinal.h"
#include "cuticle/scattering/optics.h"

namespace cuticle {

inline constexpr int lobe_count = 3;  // R, TT, TRT

enum class Azimuthal { normal, logistic };  // D

// Adds `mass` spread evenly over [a, b] radians to `bins` bins of the full circle, bin m centred at m 2pi/bins.
template <class Float> void deposit(Float a, Float b, Float mass, Float *circle, int bins) {
    const Float scale = Float(bins) / (Float(2) * pi<Float>);
    const Float x0 = math::min(a, b) * scale + Float(.5), x1 = math::max(a, b) * scale + Float(.5);
    const long first = static_cast<long>(math::floor(x0)), last = static_cast<long>(math::floor(x1));
    for (long m = first; m <= last; ++m) {
        const Float overlap = math::min(x1, Float(m + 1)) - math::max(x0, Float(m));
        const Float part = first == last ? mass : mass * overlap / (x1 - x0);
        circle[(m % bins + bins) % bins] += part;
    }
}

// A cell of the offset h >= 0: rays at its outer edge and in its middle, and its width in h.
template <class Float> struct OffsetCell {
    CrossSection<Float> edge, middle;
    Float width;
};
// All cells at one theta_d. h = sin gamma, gamma even: fine where Fresnel's term turns steep.
template <class Float> void offset_cells(Float theta_d, Float eta, int count, OffsetCell<Float> *cells) {
    const Float cos_d = math::cos(theta_d), sin_d = math::sin(theta_d), step = half_pi<Float> / Float(count);
    for (int j = 0; j < count; ++j) {
        const Float inner = step * Float(j), outer = step * Float(j + 1);
        cells[j] = {cross_section(outer, sin_d, cos_d, eta),
                    cross_section(Float(Float(.5) * (inner + outer)), sin_d, cos_d, eta),
                    math::sin(outer) - math::sin(inner)};
    }
}

// D over 2 n bins of the circle, per bin, of deviation `beta_n`. Returns the distance in bins beyond which it is nothing.
template <class Float> int smoothing_kernel(Azimuthal form, Float beta_n, int n, Float *kernel) {
    const int bins = 2 * n;
    const Float step = Float(2) * pi<Float> / Float(bins);
    // Its variance, minus what the bins (step²/12) and the table's linear interpolation (step²/6) add.
    const Float variance = math::max(Float(beta_n * beta_n - step * step * Float(.25)), Float(Float(.5) * beta_n * beta_n));
    Float total = Float(0);
    for (int m = 0; m < bins; ++m) {
        const Float x = step * Float(m < n ? m : m - bins);
        kernel[m] = Float(0);
        if (form == Azimuthal::logistic)
            kernel[m] = trimmed_logistic(x, Float(math::sqrt(Float(3 * variance)) / pi<Float>));  // deviation s pi/√3
        else
            for (int turn = -3; turn <= 3; ++turn)
                kernel[m] += gaussian(Float(x + Float(2) * pi<Float> * Float(turn)), variance);
        total += kernel[m];
    }
    int reach = 1;
    while (reach < n && kernel[reach] > Float(1e-9) * kernel[0]) ++reach;
    for (int m = 0; m < bins; ++m) kernel[m] = kernel[m] / (total * step);
    return reach;
}

// One lobe's row for one absorption, from the cells at its theta_d: out[j] = N_p at phi = j pi / n, j = 0 … n, per radian; n
// even. `kernel` and `reach`: smoothing_kernel's. `circle` is scratch of 4 n values.
template <class Float>
void azimuthal_row(int p, const OffsetCell<Float> *cells, int count, Float sigma_a, bool closed, int n, const Float *kernel,
                   int reach, Float *circle, Float *out) {
    const int bins = 2 * n;
    for (int m = 0; m < bins; ++m) circle[m] = Float(0);
    Float before = Float(p) * pi<Float>;  // h = 0
    for (int j = 0; j < count; ++j) {
        const Float after = exit_azimuth(p, cells[j].edge);
        deposit(before, after, attenuation(p, cells[j].middle, sigma_a, closed) * cells[j].width, circle, bins);
        before = after;
    }
    for (int m = 0; m <= n; ++m) {  // h and -h leave at phi and -phi
        const int other = (bins - m) % bins;
        circle[m] = circle[other] = Float(.5) * (circle[m] + circle[other]);
    }
    for (int m = 0; m < bins; ++m) circle[bins + m] = circle[m];
    for (int j = 0; j <= n; ++j) out[j] = Float(0);
    for (int d = -reach; d < reach; ++d) {
        const int bin = d < 0 ? d + bins : d;
        for (int j = 0; j <= n; ++j) out[j] += kernel[bin] * circle[bin + j];
    }
}

// N for light that arrives evenly over the front half of the azimuths (Zinke 2008, N^G): the mean of N over phi ± pi/2.
// `row` and `out` as above.
template <class Float> void spread_row(const Float *row, int n, Float *out) {
    const auto at = [&](int j) {
        const int m = ((j % (2 * n)) + 2 * n) % (2 * n);
        return row[m <= n ? m : 2 * n - m];
    };
    Float sum = Float(0);
    for (int j = -n / 2; j < n / 2; ++j) sum += Float(.5) * (at(j) + at(j + 1));
    for (int j = 0; j <= n; ++j) {
        out[j] = math::max(Float(sum / Float(n)), Float(0));  // the running sum may round below 0
        sum += Float(.5) * (at(j + n / 2) + at(j + n / 2 + 1) - at(j - n / 2) - at(j - n / 2 + 1));
    }
}

// N's energy scattered forward and backward, for light that arrives evenly over half a turn: a direction at distance d from
// straight on stays forward with probability 1 - d/pi.
template <class Float> struct Halves {
    Float forward, backward;
};

template <class Float> Halves<Float> half_energies(const Float *row, int n) {
    Halves<Float> sum{Float(0), Float(0)};
    for (int j = 0; j <= n; ++j) {
        const Float d_phi = Float(2) * pi<Float> / Float(n) * (j == 0 || j == n ? Float(.5) : Float(1));
        const Float forward = Float(j) / Float(n);  // straight on is phi = pi
        sum.forward += d_phi * forward * row[j];
        sum.backward += d_phi * (Float(1) - forward) * row[j];
    }
    return sum;
}

// A view of the rows: [rows][columns][lobe_count][channels], theta_d = i (pi/2) / (rows - 1), phi = j pi / (columns - 1).
// N is even in both angles. Memory is a pointer, or whatever ArrayTraits::gather takes.
template <class Memory> struct AzimuthalTable {
    Memory data;
    int rows, columns, channels;
};

// Four table entries and their weights: the position is found once and serves all lobes and channels.
template <class Float> struct Bilinear {
    typename ArrayTraits<Float>::Index index;  // of the first value of the lower corner
    int row_step, column_step;
    Float a, b;  // fractions towards the next row and column
};

template <class Float> CUTICLE_INLINE Place<Float> locate_inclination(const Float &theta, int rows) {
    return locate_node(Float(math::abs(theta) * Float(rows - 1) * Float(2 / pi<double>)), rows);
}
template <class Float> CUTICLE_INLINE Place<Float> locate_azimuth(const Float &phi, int columns) {
    return locate_node(Float(math::abs(math::wrap_angle(phi)) * Float(columns - 1) * Float(1 / pi<double>)), columns);
}

template <class Float, class Memory>
CUTICLE_HD Bilinear<Float> locate(const AzimuthalTable<Memory> &table, const Float &theta_d, const Float &phi) {
    using Index = typename ArrayTraits<Float>::Index;
    const Place<Float> y = locate_inclination(theta_d, table.rows), x = locate_azimuth(phi, table.columns);
    const int column = lobe_count * table.channels;
    return {(y.node * Index(table.columns) + x.node) * Index(column), table.columns * column, column, y.t, x.t};
}

template <class Value, class Float, class Memory, class Index>
CUTICLE_HD Value interpolate(const Memory &data, const Bilinear<Float> &at, const Index &offset) {
    return bilinear_value<Value>(data, Index(at.index + offset), at.row_step, at.column_step, at.a, at.b, 0);
}

// Interpolates between two absorptions. ln N is nearly linear in sigma_a, since the paths that leave in one direction have
// similar lengths.
template <class Float> CUTICLE_HD Float between_absorptions(const Float &lower_, const Float &upper_, const Float &t) {
    const Float tiny = Float(smallest<Float>), lower = math::max(lower_, tiny), upper = math::max(upper_, tiny);
    const Float log_value = math::log(lower) + t * (math::log(upper) - math::log(lower));
    return select(lower <= tiny, Float(0), Float(math::exp(log_value)));
}

// N_p of one channel.
template <class Value, class Float, class Memory>
CUTICLE_HD Value azimuthal_value(const AzimuthalTable<Memory> &table, const Bilinear<Float> &at, int p, int channel) {
    using Index = typename ArrayTraits<Float>::Index;
    return interpolate<Value>(table.data, at, Index(p * table.channels + channel));
}
template <class Value, class Float, class Memory>
CUTICLE_HD Value azimuthal_value(const AzimuthalTable<Memory> &table, const Bilinear<Float> &at, int p,
                                 const ChannelBetween<Float> &channel) {
    using Index = typename ArrayTraits<Float>::Index;
    const Index first = channel.first + Index(p * table.channels);
    return between_absorptions(interpolate<Value>(table.data, at, first),
                               interpolate<Value>(table.data, at, Index(first + Index(1))), channel.t);
}

// Absorptions in geometric steps, as channels first … first + count - 1 of a table.
template <class Scalar> struct AbsorptionRange {
    Scalar low, ratio;
    int first, count;
};

template <class Float, class Scalar>
CUTICLE_HD ChannelBetween<Float> locate(const AbsorptionRange<Scalar> &range, const Float &sigma_a) {
    using Index = typename ArrayTraits<Float>::Index;
    const double log_ratio = math::log(static_cast<double>(range.ratio));
    const Float steps = math::log(math::max(Float(sigma_a / Float(range.low)), Float(1))) * Float(1 / log_ratio);
    const Index k = index_below(steps, range.count - 2);
    const Float below = Float(range.low) * math::exp(Float(Float(k) * Float(log_ratio)));
    const Float t = (sigma_a / below - Float(1)) * Float(1 / (static_cast<double>(range.ratio) - 1));
    return {Index(k + Index(range.first)), t};
}

}  // namespace cuticle

#endif  // CUTICLE_SCATTERING_AZIMUTHAL_H
