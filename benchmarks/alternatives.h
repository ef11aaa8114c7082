// The obvious alternatives to fitted lobes for a far-field fibre, plainly written: the uniform sphere; the lobes of the
// scattering function itself after d'Eon, Marschner and Hanika 2013; a table of the distribution and its sums.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "cuticle/cuticle.h"

namespace alternatives {

using cuticle::Sample;
constexpr float pi = cuticle::pi<float>;

struct Uniform {
    float pdf(float, float, float) const { return .0795774715f; }
    Sample<float> sample(float, float, float u, float v, float) const {
        return {std::asin(2 * u - 1), pi * (2 * v - 1), .0795774715f};
    }
};

// Where x in [0, count - 1] lies between two entries.
struct Between {
    int i;
    float t;
};
inline Between between(float x, int count) {
    const float clamped = std::min(std::max(x, 0.f), float(count - 1));
    const int i = std::min(int(clamped), count - 2);
    return {i, clamped - float(i)};
}

// A lobe by its energy at the viewer's inclination; theta from M itself, exactly; phi by inverting the tabulated sums of N.
// Energy-conserving M: Eq. 7 of d'Eon 2011, drawn as in the 2013 paper, N at the viewer's inclination. Gaussian M: a
// truncated normal in theta_i, and N at theta_d.
struct FibreLobes {
    float alpha[3], beta[3];
    bool conserving;
    int rows, columns;           // inclinations 0 to pi/2, azimuths 0 to pi
    std::vector<float> n, sums;  // [lobe][row][column]: N and its integral from 0, of luminance

    const float *row(const std::vector<float> &table, int p, int i) const {
        return table.data() + (std::size_t(p) * std::size_t(rows) + std::size_t(i)) * std::size_t(columns);
    }
    Between at(float inclination) const { return between(std::fabs(inclination) * float(rows - 1) / (.5f * pi), rows); }
    float energy(int p, const Between &y) const {
        const float a = row(sums, p, y.i)[columns - 1], b = row(sums, p, y.i + 1)[columns - 1];
        return a + y.t * (b - a);
    }
    float azimuthal(int p, const Between &y, float phi) const {
        const Between x = between(std::fabs(cuticle::math::wrap_angle(phi)) * float(columns - 1) / pi, columns);
        const auto along = [&](int i) {
            const float *r = row(n, p, i) + x.i;
            return r[0] + x.t * (r[1] - r[0]);
        };
        const float a = along(y.i), b = along(y.i + 1);
        return a + y.t * (b - a);
    }
    float inclination(int p, float theta_r) const { return conserving ? theta_r : theta_r - alpha[p]; }
    float longitudinal(int p, float theta_i, float theta_r) const {
        if (conserving) return cuticle::energy_conserving_m(theta_i, 2 * alpha[p] - theta_r, 4 * beta[p] * beta[p]);
        return cuticle::longitudinal_normal(2 * alpha[p] - theta_r, 2 * beta[p]).pdf(theta_i) /
               cuticle::math::cos_theta(theta_i);
    }

    float pdf(float theta_i, float theta_r, float phi) const {
        float total = 0, density = 0;
        for (int p = 0; p < 3; ++p) {
            const float e = energy(p, at(inclination(p, theta_r)));
            const Between y = at(conserving ? theta_r : .5f * (theta_r - theta_i));
            total += e;
            density += e * longitudinal(p, theta_i, theta_r) * azimuthal(p, y, phi) / (2 * energy(p, y));
        }
        return density / total;
    }

    Sample<float> sample(float theta_r, float u_lobe, float u, float v, float w) const {
        float e[3], total = 0;
        for (int p = 0; p < 3; ++p) total += e[p] = energy(p, at(inclination(p, theta_r)));
        float x = u_lobe * total;
        int p = 0;
        for (; p < 2 && x >= e[p]; ++p) x -= e[p];
        x = std::min(x / e[p], .99999994f);
        float theta_i;
        const float cone = 2 * alpha[p] - theta_r;
        if (conserving) {
            const float variance = 4 * beta[p] * beta[p];
            const float c = 1 + variance * std::log(std::max(u, 1e-6f) + (1 - u) * std::exp(-2 / variance));
            const float s = std::sqrt(std::max(1 - c * c, 0.f));
            const float sine = c * std::sin(cone) + s * std::cos(2 * pi * v) * std::cos(cone);
            theta_i = std::asin(std::min(std::max(sine, -1.f), 1.f));
        } else {
            theta_i = cuticle::longitudinal_normal(cone, 2 * beta[p]).icdf(u);
        }
        // A row of the table, then a column, then the root of the piece between two.
        const Between y = at(conserving ? theta_r : .5f * (theta_r - theta_i));
        const float lower = (1 - y.t) * row(sums, p, y.i)[columns - 1], upper = y.t * row(sums, p, y.i + 1)[columns - 1];
        const bool second = x * (lower + upper) >= lower;
        x = second ? (x * (lower + upper) - lower) / upper : x * (lower + upper) / lower;
        const float *sum = row(sums, p, y.i + second), *value = row(n, p, y.i + second);
        const float target = x * sum[columns - 1];
        const int j = std::min(int(std::upper_bound(sum, sum + columns, target) - sum), columns - 1) - 1;
        const float step = pi / float(columns - 1), rise = (value[j + 1] - value[j]) / step, rest = target - sum[j];
        const float root = std::sqrt(std::max(value[j] * value[j] + 2 * rise * rest, 0.f)) + value[j];
        const float phi = step * float(j) + (root > 0 ? std::min(2 * rest / root, step) : 0);
        Sample<float> s{theta_i, w < .5f ? -phi : phi, 0};
        s.pdf = pdf(s.theta_i, theta_r, s.phi);
        return s;
    }
};

// Cells in theta_i and |phi|, their probabilities and sums for a set of viewers, between which the densities are mixed.
struct Table {
    int viewers, thetas, phis;
    std::vector<float> mass, rows, columns;  // [viewer][theta][phi]; sums of a viewer's thetas; sums of each theta's phis

    const float *cells(const std::vector<float> &table, int viewer, int theta) const {
        return table.data() + (std::size_t(viewer) * std::size_t(thetas) + std::size_t(theta)) * std::size_t(phis);
    }
    float pdf(float theta_i, float theta_r, float phi) const {
        const Between y = between((theta_r / pi + .5f) * float(viewers - 1), viewers);
        const int i = std::min(std::max(int((theta_i / pi + .5f) * float(thetas)), 0), thetas - 1);
        const int j = std::min(int(std::fabs(cuticle::math::wrap_angle(phi)) / pi * float(phis)), phis - 1);
        const float a = cells(mass, y.i, i)[j], b = cells(mass, y.i + 1, i)[j];
        const float cell = 2 * pi / float(phis) * pi / float(thetas);
        return (a + y.t * (b - a)) / (cell * cuticle::math::cos_theta(theta_i));
    }
    Sample<float> sample(float theta_r, float u_viewer, float u, float v, float w) const {
        const Between y = between((theta_r / pi + .5f) * float(viewers - 1), viewers);
        const int viewer = y.i + (u_viewer < y.t);
        const float *row = rows.data() + std::size_t(viewer) * std::size_t(thetas);
        const int i = std::min(int(std::upper_bound(row, row + thetas, u) - row), thetas - 1);
        const float before = i ? row[i - 1] : 0, part = (u - before) / std::max(row[i] - before, 1e-30f);
        const float *column = cells(columns, viewer, i);
        const int j = std::min(int(std::upper_bound(column, column + phis, v) - column), phis - 1);
        const float left = j ? column[j - 1] : 0, share = (v - left) / std::max(column[j] - left, 1e-30f);
        const float phi = pi * (float(j) + std::min(share, .9999f)) / float(phis);
        Sample<float> s{pi * ((float(i) + std::min(part, .9999f)) / float(thetas) - .5f), w < .5f ? -phi : phi, 0};
        s.pdf = pdf(s.theta_i, theta_r, s.phi);
        return s;
    }
};

}  // namespace alternatives
