// The density grid of a scene's hair, built from the control points of its curves, in Mitsuba's memory.
#pragma once

#include "drjit_traits.h"

#include <mitsuba/render/scene.h>
#include <mitsuba/render/shape.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <string_view>
#include <vector>

#include "cuticle/groom/density_grid.h"
#include "mixture.h"

namespace cuticle_mitsuba {

// The control points (x y z radius each) and the first control point of each cubic segment, read off a shape. `places` are
// the 3 x 4 matrices that move them into the scene.
template <class Float> class CurveReader final : public mitsuba::TraversalCallback {
  public:
    struct Place {
        std::array<float, 12> rows;
        float scale;  // of radii
    };
    const mitsuba::Object *shape = nullptr;
    size_t kind = 0;  // of hair
    std::vector<float> points;
    std::vector<uint32_t> segments;
    std::vector<Place> places;

    bool found() const { return !points.empty() && !segments.empty(); }

  protected:
    using UInt32 = dr::uint32_array_t<Float>;

    void put_value(std::string_view name, void *value, uint32_t, const std::type_info &) override {
        if (name == "control_points") copy(*static_cast<mitsuba::DynamicBuffer<Float> *>(value), points);
        else if (name == "segment_indices") copy(*static_cast<mitsuba::DynamicBuffer<UInt32> *>(value), segments);
    }
    void put_object(std::string_view, mitsuba::Object *, uint32_t) override {}

  private:
    template <class From, class To> static void copy(const From &from, std::vector<To> &to) {
        auto host = dr::migrate(from, JitBackend::None);
        if constexpr (dr::is_jit_v<From>) dr::sync_thread();
        to.assign(host.data(), host.data() + host.size());
    }
};

template <class Float> class HairGrid {
    using Mask = dr::mask_t<Float>;

  public:
    // Adds a shape's curves, of a kind of hair, moved by a transform; false where it has none that can be read.
    template <class Shape, class Transform> bool add(Shape *shape, const Transform &to_world, size_t kind) {
        auto known = std::find_if(m_curves.begin(), m_curves.end(), [&](const auto &c) { return c.shape == shape; });
        if (known == m_curves.end()) {
            CurveReader<Float> reader;
            reader.shape = shape;
            reader.kind = kind;
            shape->traverse(&reader);
            if (!reader.found()) return false;
            for (const uint32_t first : reader.segments)
                if ((size_t(first) + 4) * 4 > reader.points.size()) return false;
            m_curves.push_back(std::move(reader));
            known = m_curves.end() - 1;
        }
        typename CurveReader<Float>::Place place;
        for (size_t k = 0; k < place.rows.size(); ++k) place.rows[k] = float(to_world.matrix(k / 4, k % 4));
        place.scale = std::cbrt(float(dr::abs(dr::det(to_world.matrix))));
        known->places.push_back(place);
        return true;
    }

    // Forgets what was added since the last time.
    void clear() { m_curves.clear(); }

    // Makes the grid of all that was added since the last time, `cells` along its longest side; keeps it where the curves
    // are the same.
    void build(int cells) {
        uint64_t mark = 1469598103934665603u;  // FNV-1a, a word at a time
        const auto add_word = [&mark](uint32_t bits) { mark = (mark ^ bits) * 1099511628211u; };
        const auto add_float = [&](float x) {
            uint32_t bits;
            std::memcpy(&bits, &x, sizeof bits);
            add_word(bits);
        };
        for (const auto &curves : m_curves) {
            add_word(uint32_t(curves.kind));
            for (const float x : curves.points) add_float(x);
            for (const auto &place : curves.places)
                for (const float x : place.rows) add_float(x);
            for (const uint32_t first : curves.segments) add_word(first);
        }
        if (mark != m_mark) deposit(cells);
        m_mark = mark;
        clear();
    }

    // Expected strands of a kind from `origin`, on a strand, along `direction`, up to `distance`. What is seen lies at the
    // hair's edge, where less of its cell's hair is before it than the cell's mean says: the walk begins a quarter of a cell
    // on, which brings the brightness of black hair to what exact counting gives (benchmarks/dual_scattering.py). `offset`
    // moves the ray against the grid, by cells along each axis: at random from -1/2 to 1/2, it blurs the cells' borders
    // away.
    template <class Point, class Vector>
    Float strands(size_t kind, const Point &origin, const Vector &direction, const Float &distance, const Mask &at_edge,
                  const Vector &offset) const {
        const Float skip =
            dr::select(at_edge, dr::minimum(distance, .25f / 3.f * (m_grid.cell[0] + m_grid.cell[1] + m_grid.cell[2])), 0.f);
        return walk(m_grid, m_values[kind], origin + direction * skip, direction, distance - skip, offset);
    }

    // The same up to the end of the hair, of all kinds, roughly: in wider cells.
    template <class Point, class Vector>
    Float strands_roughly(const Point &origin, const Vector &direction, const Mask &active, const Vector &offset) const {
        return walk(m_rough, m_rough_values, origin, direction, dr::select(active, dr::Largest<Float>, 0.f), offset);
    }

    std::vector<Buffer<Float>> m_values;  // of each kind
    Buffer<Float> m_rough_values;

  private:
    static constexpr int pieces = 4;  // of a segment, each straight
    static constexpr int rough = 4;   // times as wide are the wider cells

    using Grid = cuticle::DensityGrid<float>;

    template <class Point, class Vector>
    static Float walk(const Grid &grid, const Buffer<Float> &values, const Point &origin, const Vector &direction,
                      const Float &distance, const Vector &offset) {
        const cuticle::DensityGrid<float, Memory<Float>> view{memory<Float>(values),
                                                              {grid.size[0], grid.size[1], grid.size[2]},
                                                              {grid.lower[0], grid.lower[1], grid.lower[2]},
                                                              {grid.cell[0], grid.cell[1], grid.cell[2]}};
        const Float from[3] = {origin.x() + offset.x() * grid.cell[0], origin.y() + offset.y() * grid.cell[1],
                               origin.z() + offset.z() * grid.cell[2]};
        return cuticle::count_strands(view, from, cuticle::Direction<Float>{direction.x(), direction.y(), direction.z()},
                                      distance);
    }

    // A uniform cubic B-spline with the control points p[0..3], x y z radius each, at t in [0, 1].
    static void spline(const float *p, float t, float *out) {
        const float s = 1 - t;
        const float w[] = {s * s * s / 6, (3 * t * t * t - 6 * t * t + 4) / 6, (3 * s * s * s - 6 * s * s + 4) / 6,
                           t * t * t / 6};
        for (int a = 0; a < 4; ++a) out[a] = w[0] * p[a] + w[1] * p[4 + a] + w[2] * p[8 + a] + w[3] * p[12 + a];
    }

    // Calls use(from, to, radius, kind) for the straight pieces of all curves, wherever they stand.
    template <class Use> void each_piece(const Use &use) const {
        for (const auto &curves : m_curves)
            for (const auto &place : curves.places) {
                const auto row = [&](size_t a) { return &place.rows[4 * a]; };
                for (const uint32_t first : curves.segments) {
                    float p[16];
                    for (size_t k = 0; k < 4; ++k) {
                        const float *c = curves.points.data() + 4 * (size_t(first) + k);
                        for (size_t a = 0; a < 3; ++a)
                            p[4 * k + a] = row(a)[0] * c[0] + row(a)[1] * c[1] + row(a)[2] * c[2] + row(a)[3];
                        p[4 * k + 3] = place.scale * c[3];
                    }
                    float from[4], to[4];
                    spline(p, 0, from);
                    for (int k = 1; k <= pieces; ++k) {
                        spline(p, float(k) / pieces, to);
                        use(from, to, .5f * (from[3] + to[3]), curves.kind);
                        std::copy(to, to + 4, from);
                    }
                }
            }
    }

    void deposit(int cells) {
        float low[3], high[3], widest = 0, longest = 0;
        for (int a = 0; a < 3; ++a) {
            low[a] = std::numeric_limits<float>::max();
            high[a] = std::numeric_limits<float>::lowest();
        }
        size_t kinds = 0;
        each_piece([&](const float *from, const float *to, float radius, size_t kind) {
            kinds = std::max(kinds, kind + 1);
            for (size_t a = 0; a < 3; ++a) {
                low[a] = std::min({low[a], from[a], to[a]});
                high[a] = std::max({high[a], from[a], to[a]});
            }
            widest = std::max(widest, radius);
        });
        for (int a = 0; a < 3; ++a) {
            low[a] -= widest;
            high[a] += widest;
            longest = std::max(longest, high[a] - low[a]);
        }
        size_t count = cuticle::density_columns;
        for (int a = 0; a < 3; ++a) {
            m_grid.size[a] = std::clamp(int(std::ceil(float(cells) * (high[a] - low[a]) / longest)), 1, cells);
            m_grid.lower[a] = low[a];
            m_grid.cell[a] = (high[a] - low[a]) / float(m_grid.size[a]);
            count *= size_t(m_grid.size[a]);
        }
        std::vector<std::vector<float>> values(kinds, std::vector<float>(count, 0.f));
        each_piece([&](const float *from, const float *to, float radius, size_t kind) {
            cuticle::deposit_strand(m_grid, values[kind].data(), from, to, radius);
        });
        m_values.clear();
        for (const auto &own : values) m_values.push_back(dr::load<Buffer<Float>>(own.data(), count));
        for (size_t k = 1; k < kinds; ++k)
            std::transform(values[0].begin(), values[0].end(), values[k].begin(), values[0].begin(), std::plus<float>());
        m_grid.cells = values[0].data();
        count = cuticle::density_columns;
        m_rough = m_grid;
        for (int a = 0; a < 3; ++a) {
            m_rough.size[a] = cuticle::coarse_size(m_grid.size[a], rough);
            m_rough.cell[a] = float(rough) * m_grid.cell[a];
            count *= size_t(m_rough.size[a]);
        }
        std::vector<float> rough_values(count);
        cuticle::coarsen(m_grid, rough, rough_values.data());
        m_rough_values = dr::load<Buffer<Float>>(rough_values.data(), rough_values.size());
        for (auto &own : m_values) dr::make_opaque(own);
        dr::make_opaque(m_rough_values);
        m_grid.cells = m_rough.cells = nullptr;
    }

    std::vector<CurveReader<Float>> m_curves;
    uint64_t m_mark = 0;       // of the curves in the grid
    Grid m_grid{}, m_rough{};  // where and how wide; the values stand in Mitsuba's memory
};

}  // namespace cuticle_mitsuba
