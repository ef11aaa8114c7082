// How many strands lie between a point and the light: a grid of hair density, anisotropic in the strands' direction.
//
// A piece of strand of length l, radius r and direction t has the shadow 2 r l |sin(t, d)| across a ray along d. A cell
// holds M = Σ 2 r l t tᵀ / volume; its trace is the shadow of all pieces across their own direction, and the strands that a
// ray crosses per unit length are about tr M sqrt(1 - dᵀ M d / tr M): exact where the cell's strands are parallel, 4 % high
// where they point everywhere alike (√(2/3) for π/4), 41 % high where half of them lie along the ray and half across it.
#pragma once

#include "cuticle/angles.h"

namespace cuticle {

// The upper triangle of M: xx, yy, zz, xy, xz, yz.
constexpr int density_columns = 6;

// A view, owning nothing: cells[z][y][x][density_columns] over the box from `lower`, each `cell` wide.
template <class Scalar> struct DensityGrid {
    const Scalar *cells;
    int size[3];  // cells along x, y, z
    Scalar lower[3], cell[3];
};

// Adds a piece of strand from a to b, of one radius, to the cells (which are the view's, not const): in steps of at most a
// quarter of a cell, each to the cell of its middle. What lies outside the box is left out.
template <class Scalar>
void deposit_strand(const DensityGrid<Scalar> &grid, Scalar *cells, const Scalar *a, const Scalar *b, Scalar radius) {
    Scalar along[3], length = Scalar(0), steps = Scalar(1);
    for (int i = 0; i < 3; ++i) {
        along[i] = b[i] - a[i];
        length = length + along[i] * along[i];
        steps = math::max(steps, Scalar(math::abs(along[i]) / grid.cell[i] * Scalar(4)));
    }
    if (!(length > Scalar(0))) return;
    length = math::sqrt(length);
    const int count = static_cast<int>(math::min(steps, Scalar(1e6))) + 1;
    const Scalar shadow = Scalar(2) * radius * length / (Scalar(count) * grid.cell[0] * grid.cell[1] * grid.cell[2]);
    const Scalar x = along[0] / length, y = along[1] / length, z = along[2] / length;
    const Scalar tensor[density_columns] = {x * x, y * y, z * z, x * y, x * z, y * z};
    for (int k = 0; k < count; ++k) {
        int index = 0;
        bool inside = true;
        for (int i = 2; i >= 0; --i) {
            const Scalar at = (a[i] + along[i] * (Scalar(k) + Scalar(.5)) / Scalar(count) - grid.lower[i]) / grid.cell[i];
            inside = inside && at >= Scalar(0) && at < Scalar(grid.size[i]);
            if (inside) index = index * grid.size[i] + static_cast<int>(at);
        }
        if (!inside) continue;
        for (int c = 0; c < density_columns; ++c) cells[index * density_columns + c] += shadow * tensor[c];
    }
}

// Strands crossed per unit length along the unit direction d in one cell.
template <class Float, class Scalar> CUTICLE_HD Float crossing_rate(const Scalar *m, const Direction<Float> &d) {
    const Float trace = Float(m[0]) + Float(m[1]) + Float(m[2]);
    const Float along = d.x * d.x * Float(m[0]) + d.y * d.y * Float(m[1]) + d.z * d.z * Float(m[2]) +
                        Float(2) * (d.x * d.y * Float(m[3]) + d.x * d.z * Float(m[4]) + d.y * d.z * Float(m[5]));
    return math::sqrt(math::max(Float(trace * (trace - along)), Float(0)));
}

// Expected number of strands on the way from `origin` along the unit direction `d`, up to `distance`: the sum of the rates
// of the cells on the way, each times the length within it.
template <class Float, class Scalar>
CUTICLE_HD Float count_strands(const DensityGrid<Scalar> &grid, const Float *origin, const Direction<Float> &d,
                               const Float &distance) {
    const Float direction[3] = {d.x, d.y, d.z};
    // Where the ray is inside the box.
    Float enter = Float(0), leave = distance;
    for (int a = 0; a < 3; ++a) {
        const Float low = Float(grid.lower[a]), high = low + Float(grid.cell[a]) * Float(grid.size[a]);
        if (direction[a] == Float(0)) {
            if (origin[a] < low || origin[a] > high) return Float(0);
            continue;
        }
        const Float to_low = (low - origin[a]) / direction[a], to_high = (high - origin[a]) / direction[a];
        enter = math::max(enter, math::min(to_low, to_high));
        leave = math::min(leave, math::max(to_low, to_high));
    }
    if (!(enter < leave)) return Float(0);
    // From cell to cell (Amanatides and Woo 1987).
    int at[3], step[3];
    Float next[3], apart[3];
    for (int a = 0; a < 3; ++a) {
        const Float width = Float(grid.cell[a]);
        const Float x = (origin[a] + enter * direction[a] - Float(grid.lower[a])) / width;
        at[a] = math::max(0, math::min(static_cast<int>(x), grid.size[a] - 1));
        step[a] = direction[a] < Float(0) ? -1 : 1;
        if (direction[a] == Float(0)) {
            next[a] = apart[a] = std::numeric_limits<Float>::infinity();
            continue;
        }
        apart[a] = width / math::abs(direction[a]);
        const Float border = Float(grid.lower[a]) + width * Float(at[a] + (step[a] > 0 ? 1 : 0));
        next[a] = math::max(Float((border - origin[a]) / direction[a]), enter);
    }
    Float total = Float(0), here = enter;
    while (true) {
        const int a = next[0] < next[1] ? (next[0] < next[2] ? 0 : 2) : (next[1] < next[2] ? 1 : 2);
        const Float until = math::min(next[a], leave);
        const int index = (at[2] * grid.size[1] + at[1]) * grid.size[0] + at[0];
        total = total + crossing_rate(grid.cells + index * density_columns, d) * (until - here);
        here = until;
        if (!(next[a] < leave)) return total;
        at[a] += step[a];
        if (at[a] < 0 || at[a] >= grid.size[a]) return total;
        next[a] = next[a] + apart[a];
    }
}

}  // namespace cuticle
