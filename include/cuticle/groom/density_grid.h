// Counts the strands between a point and the light, by a grid of hair density that depends on direction.
//
// A piece of strand of length l, radius r and direction t casts the shadow 2 r l |sin(t, d)| along a ray of direction d. A
// cell holds M = Σ 2 r l t tᵀ / volume, whose trace is the shadow of all pieces seen from the side. A ray crosses about tr
// M sqrt(1 - dᵀ M d / tr M) strands per unit length: exact where the cell's strands are parallel, 4 % high where they point
// in all directions alike (√(2/3) for π/4), 41 % high where half of them lie along the ray and half across it.
#ifndef CUTICLE_GROOM_DENSITY_GRID_H
#define CUTICLE_GROOM_DENSITY_GRID_H

#include "cuticle/math/angles.h"

namespace cuticle {

// The upper triangle of M: xx, yy, zz, xy, xz, yz.
inline constexpr int density_columns = 6;

// A view that owns nothing: cells[z][y][x][density_columns] over the box from `lower`, each `cell` wide. Memory is a
// pointer, or whatever ArrayTraits::gather takes.
template <class Scalar, class Memory = const Scalar *> struct DensityGrid {
    Memory cells;
    int size[3];  // cells along x, y, z
    Scalar lower[3], cell[3];
};

// Adds a straight piece of strand of constant radius, from a to b, to `cells` (the view's own, but writable), in steps of
// at most a quarter of a cell, each into the cell of its midpoint. Steps outside the box are left out.
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

// The same hair in cells `factor` times as wide, from the same corner: their number along an axis, and their values, means
// over the finer cells. A walk takes fewer steps, for uses that tolerate the blur.
constexpr int coarse_size(int size, int factor) { return (size + factor - 1) / factor; }
template <class Scalar> void coarsen(const DensityGrid<Scalar> &grid, int factor, Scalar *cells) {
    const int wide = coarse_size(grid.size[0], factor), high = coarse_size(grid.size[1], factor);
    const int deep = coarse_size(grid.size[2], factor);
    for (int i = 0; i < wide * high * deep * density_columns; ++i) cells[i] = Scalar(0);
    const Scalar share = Scalar(1) / static_cast<Scalar>(factor * factor * factor);
    const Scalar *from = grid.cells;
    for (int z = 0; z < grid.size[2]; ++z)
        for (int y = 0; y < grid.size[1]; ++y)
            for (int x = 0; x < grid.size[0]; ++x) {
                Scalar *to = cells + ((z / factor * high + y / factor) * wide + x / factor) * density_columns;
                for (int c = 0; c < density_columns; ++c) to[c] += share * *from++;
            }
}

// Strands crossed per unit length along the unit direction d in the cell whose values begin at `first`.
template <class Float, class Memory>
CUTICLE_HD Float crossing_rate(const Memory &cells, const typename ArrayTraits<Float>::Index &first,
                               const Direction<Float> &d) {
    using Traits = ArrayTraits<Float>;
    using Index = typename Traits::Index;
    const auto m = [&](int column) { return Traits::gather(cells, Index(first + Index(column))); };
    const Float xx = m(0), yy = m(1), zz = m(2), trace = xx + yy + zz;
    const Float along = d.x * d.x * xx + d.y * d.y * yy + d.z * d.z * zz +
                        Float(2) * (d.x * d.y * m(3) + d.x * d.z * m(4) + d.y * d.z * m(5));
    return math::sqrt(math::max(Float(trace * (trace - along)), Float(0)));
}

// The state of a walk from cell to cell (Amanatides and Woo 1987); distances are from where the ray enters the box.
template <class Float> struct GridWalk {
    using Index = typename ArrayTraits<Float>::Index;
    Float next[3];  // distance to the border ahead along each axis
    Index first;    // of the cell's values
    Float here, total;

    template <class Use> auto apply(const Use &use) { return use(next[0], next[1], next[2], first, here, total); }
};

// Expected number of strands from `origin` along the unit direction `d`, up to `distance`: the sum over the cells of the
// rate in a cell times the length within it.
template <class Float, class Scalar, class Memory>
CUTICLE_HD Float count_strands(const DensityGrid<Scalar, Memory> &grid, const Float *origin, const Direction<Float> &d,
                               const Float &distance) {
    using Traits = ArrayTraits<Float>;
    using Index = typename Traits::Index;
    const Float farthest = Float(largest<Float>), zero = Float(0);
    const Float along[3] = {d.x, d.y, d.z};
    // The part of the ray inside the box. A direction without a component along an axis meets neither of its borders.
    Float slow[3], enter = zero, leave = distance;
    for (int a = 0; a < 3; ++a) {
        const Float low = Float(grid.lower[a]) - origin[a], high = low + Float(grid.cell[a]) * Float(grid.size[a]);
        const auto still = math::abs(along[a]) < Float(1e-20);
        slow[a] = Float(1) / select(still, Float(1), along[a]);
        const Float to_low = select(still, select(low > zero, farthest, Float(-farthest)), Float(low * slow[a]));
        const Float to_high = select(still, select(high < zero, Float(-farthest), farthest), Float(high * slow[a]));
        enter = math::max(enter, math::min(to_low, to_high));
        leave = math::min(leave, math::max(to_low, to_high));
        slow[a] = select(still, farthest, slow[a]);
    }
    // Per axis: the distance between borders, and what a step adds to the cell's index. The walk ends before the rounding
    // of its sums could take it past the last cell.
    Float apart[3], end = leave - enter;
    Index step[3];
    GridWalk<Float> walk;
    walk.first = Index(0);
    walk.here = walk.total = zero;
    int stride = density_columns;
    for (int a = 0; a < 3; ++a) {
        const Float width = Float(grid.cell[a]), last = Float(grid.size[a] - 1);
        const auto back = along[a] < zero, still = slow[a] >= farthest;
        const Float x = (origin[a] + math::min(enter, distance) * along[a] - Float(grid.lower[a])) / width;
        const Float cell = math::floor(math::clamp(x, zero, Float(last + Float(.5))));
        const Float ahead = (cell + select(back, zero, Float(1)) - x) * width * slow[a];
        walk.next[a] = select(still, farthest, math::max(ahead, zero));
        apart[a] = select(still, zero, Float(width * math::abs(slow[a])));
        const Float out = walk.next[a] + select(back, cell, Float(last - cell)) * apart[a];
        end = math::min(end, select(still, farthest, Float(out * Float(1 - 1e-4))));
        walk.first = walk.first + index_below(cell, grid.size[a] - 1) * Index(stride);
        step[a] = select(back, Index(-stride), Index(stride));
        stride *= grid.size[a];
    }
    Traits::loop(
        walk, [&](const GridWalk<Float> &w) { return w.here < end; },
        [&](GridWalk<Float> &w) {
            const Float ahead = math::min(w.next[0], math::min(w.next[1], w.next[2]));
            const Float until = math::min(ahead, end);
            w.total = w.total + crossing_rate<Float>(grid.cells, w.first, d) * (until - w.here);
            w.here = until;
            for (int a = 0; a < 3; ++a) {
                const auto met = w.next[a] <= ahead;
                w.next[a] = w.next[a] + select(met, apart[a], zero);
                w.first = w.first + select(met, step[a], Index(0));
            }
        });
    return walk.total;
}

}  // namespace cuticle

#endif  // CUTICLE_GROOM_DENSITY_GRID_H
