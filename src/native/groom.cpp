// Hair density grids: built from strands, and counted along rays.
#include "arrays.h"
#include "bindings.h"
#include "cuticle/groom/density_grid.h"

#include <array>
#include <cstdint>

namespace native {
namespace {

// cells: (z, y, x, density_columns); lower, cell: (3).
cuticle::DensityGrid<float> view(const float *cells, const In<float> &lower, const In<float> &cell, const int *size) {
    cuticle::DensityGrid<float> grid{cells, {size[0], size[1], size[2]}, {}, {}};
    for (int a = 0; a < 3; ++a) {
        grid.lower[a] = lower.data()[a];
        grid.cell[a] = cell.data()[a];
    }
    return grid;
}

template <class Array> std::array<int, 3> sizes(const Array &cells) {
    return {static_cast<int>(cells.shape(2)), static_cast<int>(cells.shape(1)), static_cast<int>(cells.shape(0))};
}

// points: (N, 3), radius: (N), offsets: (strands + 1); adds to cells.
void density_grid(const In<float> &points, const In<float> &radius, const In<std::int64_t> &offsets, const In<float> &lower,
                  const In<float> &cell, Out<float> cells) {
    const auto size = sizes(cells);
    const auto grid = view(cells.data(), lower, cell, size.data());
    const float *p = points.data(), *r = radius.data();
    for (std::size_t k = 0; k + 1 < offsets.size(); ++k)
        for (std::int64_t i = offsets.data()[k]; i + 1 < offsets.data()[k + 1]; ++i)
            cuticle::deposit_strand(grid, cells.data(), p + 3 * i, p + 3 * (i + 1), .5f * (r[i] + r[i + 1]));
}

// origin, direction: (N, 3); distance: (N) or (1).
void count_strands(const In<float> &cells, const In<float> &lower, const In<float> &cell, const In<float> &origin,
                   const In<float> &direction, const In<float> &distance, Out<float> out) {
    const auto size = sizes(cells);
    const auto grid = view(cells.data(), lower, cell, size.data());
    const auto limit = broadcast(distance);
    parallel_for(out.size(), 256, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i) {
            const float *d = direction.data() + 3 * i;
            const cuticle::Direction<float> along{d[0], d[1], d[2]};
            out.data()[i] = cuticle::count_strands(grid, origin.data() + 3 * i, along, limit[i]);
        }
    });
}

}  // namespace

void bind_groom(nb::module_ &m) {
    m.def("density_grid", &density_grid, nb::call_guard<nb::gil_scoped_release>());
    m.def("count_strands", &count_strands, nb::call_guard<nb::gil_scoped_release>());
    m.attr("density_columns") = cuticle::density_columns;
}

}  // namespace native
