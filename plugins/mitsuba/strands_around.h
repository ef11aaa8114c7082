// What lies around a point of a scene's hair: other strands, counted on the way to a light, and what is no hair.
#pragma once

#include "drjit_traits.h"

#include <mitsuba/core/properties.h>
#include <mitsuba/core/string.h>
#include <mitsuba/render/bsdf.h>
#include <mitsuba/render/emitter.h>
#include <mitsuba/render/scene.h>

#include <algorithm>
#include <atomic>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "hair_grid.h"
#include "instances.h"
#include "strands.h"

NAMESPACE_BEGIN(mitsuba)

template <typename Float, typename Spectrum> class StrandsAround {
  public:
    MI_IMPORT_TYPES(Scene, Sampler, Shape, ShapeGroup, BSDF, BSDFPtr)

    // Strands around, and those toward the light of each kind of hair, which is a BSDF, where there are several.
    struct Around : cuticle_mitsuba::Around<Float> {
        std::vector<Float> kinds;
    };

    // How strands are counted: from hit to hit, up to `most`, or in a grid of so many cells; those behind, too.
    bool trace, behind;
    int cells, most;

    cuticle_mitsuba::HairGrid<Float> grid;

    bool some_hair() const { return m_some_hair; }
    const ScalarBoundingBox3f &box() const { return m_box; }

    // Forgets the scene: what it holds may have changed since.
    void forget() { m_scene = nullptr; }

    // Once per scene: its hair's grid, and a scene of everything else.
    void prepare(const Scene *scene) {
        if (m_scene == scene) return;
        std::lock_guard<std::mutex> guard(m_mutex);
        if (m_scene == scene) return;
        m_others = nullptr;
        Properties others("scene");
        std::vector<ref<Shape>> kept;
        bool some_hair = false, all_read = !trace || behind;
        m_draws = false;
        m_box.reset();
        m_kinds.clear();
        grid.clear();  // of a scene that was refused
        for (const ref<Shape> &shape : scene->shapes()) {
            const Placed<Float, Spectrum> placed(scene, shape);
            size_t hairs = 0;
            for (const ref<Shape> &part : placed.parts) {
                if (part->bsdf() && part->bsdf()->flags() & cuticle_mitsuba::hair_flag)
                    const_cast<BSDF *>(part->bsdf())->parameters_changed({cuticle_mitsuba::strand_tables});
                const uint32_t flags = part->bsdf() ? part->bsdf()->flags() : 0u;
                if (!(flags & cuticle_mitsuba::hair_flag)) continue;
                if (!string::starts_with(part->bsdf()->class_name(), "Cuticle"))
                    Throw("dual_scattering: hair must have a BSDF `cuticle` by itself, got one inside a %s",
                          part->bsdf()->class_name());
                ++hairs;
                const auto kind = std::find(m_kinds.begin(), m_kinds.end(), part->bsdf());
                const size_t k = size_t(kind - m_kinds.begin());
                if (kind == m_kinds.end()) m_kinds.push_back(part->bsdf());
                all_read = all_read && grid.add(const_cast<Shape *>(part.get()), placed.to_world, k);
                if (!trace && !all_read)
                    Throw(
                        "dual_scattering: hair must be a bsplinecurve for counter = grid, got %s; use bsplinecurve, or "
                        "counter = trace",
                        part->class_name());
                m_draws = m_draws || !(flags & cuticle_mitsuba::mean_flag);
            }
            if (hairs > 0) {
                if (hairs < placed.parts.size())
                    Throw("dual_scattering: a shapegroup must hold hair or other shapes, not both; make it two of them");
                some_hair = true;
                m_box.expand(shape->bbox());
            } else {
                others.set("shape" + std::to_string(kept.size()), ref<Object>(const_cast<Shape *>(shape.get())));
                kept.push_back(shape);
            }
        }
        if (!some_hair && !std::exchange(m_told, true))
            Log(Warn,
                "dual_scattering: no shape has a BSDF `cuticle` whose fibre can stand among others: all is lit as by "
                "`direct`");
        m_has_grid = some_hair && all_read;
        if (m_has_grid) grid.build(cells);
        else grid.clear();
        if (!kept.empty() && some_hair) {
            for (const auto &group : scene->shapegroups())
                others.set("group" + std::string(group->id()), ref<Object>(const_cast<ShapeGroup *>(group.get())));
            m_others = new Scene(others);
            // The shapes stay the first scene's.
            for (const ref<Shape> &shape : kept)
                if (shape->is_emitter()) const_cast<Shape *>(shape.get())->emitter()->set_scene(scene);
        }
        m_some_hair = some_hair;
        m_scene = scene;
    }

    // Strands around a hair on its way to the light (elsewhere none), from the hair's edge where it is seen or from within;
    // `lit` loses what stands in the shadow of something that is no hair.
    Around strands_between(const Scene *scene, const Ray3f &toward, const Mask &hair, const Mask &at_edge, Mask &lit,
                           Sampler *sampler) const {
        if (!m_some_hair) lit &= !scene->ray_test(toward, false, lit);
        else if (m_others) lit &= !m_others->ray_test(toward, false, lit);
        const Around around = count(scene, toward, at_edge, hair && lit, sampler);
        lit &= around.strands >= 0.f;
        return around;
    }

    // What hair passes on of the light along a ray that starts on no hair. A ray that meets no strand loses nothing.
    Spectrum transmittance(const Scene *scene, const Ray3f &toward, const Mask &active, Sampler *sampler) const {
        Spectrum passed(1.f);
        if (!m_some_hair || dr::none_or<false>(active)) return passed;
        const SurfaceInteraction3f si = scene->ray_intersect(toward, +RayFlags::All, false, active);
        Mask met = active && si.is_valid();
        if (dr::none_or<false>(met)) return passed;
        const BSDFPtr first = si.bsdf();
        met &= is_hair(first);
        if (dr::none_or<false>(met)) return passed;
        const Around around = count(scene, toward, false, met, sampler);
        const Vector3f wo = si.to_local(toward.d);
        Float own = trace ? around.strands : around.expected;
        for (size_t k = 0; k < around.kinds.size(); ++k) {
            const Mask same = first == BSDFPtr(m_kinds[k]);
            dr::masked(own, same) = around.kinds[k];
            dr::masked(passed, met && !same) *= passed_on(m_kinds[k], si, wo, around.kinds[k], met && !same, false);
        }
        dr::masked(passed, met) *= passed_on(first, si, wo, own, met, true);
        return passed;
    }

    // f takes all strands on the way for the shaded one's kind: what the others pass on, out of what its own would.
    Spectrum other_kinds(const BSDFPtr &bsdf, const SurfaceInteraction3f &si, const Vector3f &wo, const Around &around,
                         const Mask &active) const {
        Spectrum ratio(1.f);
        for (size_t k = 0; k < around.kinds.size(); ++k) {
            const Float &n = around.kinds[k];
            const Mask other = active && bsdf != BSDFPtr(m_kinds[k]) && n > 0.f;
            if (dr::none_or<false>(other)) continue;
            const Spectrum own = passed_on(bsdf, si, wo, n, other, false);
            const Spectrum theirs = passed_on(m_kinds[k], si, wo, n, other, false);
            dr::masked(ratio, other) *= dr::select(own > 0.f, theirs / own, 0.f);
        }
        return ratio;
    }

    static Mask is_hair(const BSDFPtr &bsdf) { return (bsdf->flags() & cuticle_mitsuba::hair_flag) != 0u; }

    // Strands toward the light, -1 where something that is no hair blocks the way (found while tracing only), and beyond.
    Around count(const Scene *scene, const Ray3f &toward, const Mask &at_edge, const Mask &active, Sampler *sampler) const {
        Around around{{Float(0.f), Float(0.f), Float(cuticle::half_space<Float>)}, {}};
        if (!m_some_hair) return around;
        Vector3f offset(0.f);
        if (m_has_grid) {
            const Point2f u = sampler->next_2d(active);
            offset = Vector3f(u.x(), u.y(), sampler->next_1d(active)) - .5f;
        }
        if (behind && m_has_grid) around.behind = grid.strands_roughly(toward.o, -toward.d, active, offset);
        Float &all = trace ? around.strands : around.expected;
        for (size_t k = 0; k < m_kinds.size(); ++k) {
            const Float own =
                trace ? traced(scene, toward, m_kinds[k], active)
                      : grid.strands(k, toward.o, toward.d, dr::select(active, toward.maxt, 0.f), at_edge, offset);
            all = dr::select(own < 0.f, own, all + own);
            if (m_kinds.size() > 1) around.kinds.push_back(own);
        }
        if (m_draws && !trace) around.strands = poisson(around.expected, sampler->next_1d(active));
        return around;
    }

    // The first thing along a ray that is not hair, or where it is not to be looked through the first thing.
    SurfaceInteraction3f beyond_hair(const Scene *scene, const Ray3f &ray, const Mask &through, const Mask &active) const {
        SurfaceInteraction3f si = dr::zeros<SurfaceInteraction3f>();
        si.wi = -ray.d;
        si.time = ray.time;
        si.wavelengths = ray.wavelengths;
        si.t = dr::Infinity<Float>;
        const Mask beyond = active && through && m_some_hair, elsewhere = active && !beyond;
        if (m_others && dr::any_or<true>(beyond)) {
            const SurfaceInteraction3f found = m_others->ray_intersect(ray, +RayFlags::All, false, beyond);
            dr::masked(si, beyond) = found;
        }
        if (dr::any_or<true>(elsewhere)) {
            const SurfaceInteraction3f found = scene->ray_intersect(ray, +RayFlags::All, false, elsewhere);
            dr::masked(si, elsewhere) = found;
        }
        return si;
    }

  private:
    // What so many strands of a kind pass on, of light that meets some of them or of all light.
    template <class Kind>
    Spectrum passed_on(const Kind &bsdf, SurfaceInteraction3f si, const Vector3f &wo, const Float &strands,
                       const Mask &active, bool met) const {
        cuticle_mitsuba::set_around(si, cuticle_mitsuba::Around<Float>{strands, strands, Float(0.f)});
        const uint32_t random = trace ? 0u : cuticle_mitsuba::expected_bit;
        const auto context = cuticle_mitsuba::among_strands_context(cuticle_mitsuba::transmittance_bit | random);
        const Spectrum passed = bsdf->eval(context, si, wo, active);
        if (met) return passed;
        const Float none = trace ? dr::select(strands > 0.f, Float(0.f), Float(1.f)) : Float(dr::exp(-strands));
        return none + (1.f - none) * passed;
    }

    // Strands scatter about their expectation as counts do, and E[a^N] = exp(tau (a - 1)) is not a^tau: N is drawn.
    static Float poisson(const Float &expected, const Float &u) {
        constexpr int terms = 24;
        const Float small = dr::minimum(expected, 8.f);
        Float mass = dr::exp(-small), below = mass, n(0.f);
        for (int k = 1; k < terms; ++k) {
            n += dr::select(u >= below, Float(1.f), Float(0.f));
            mass *= small / ScalarFloat(k);
            below += mass;
        }
        const Float z = cuticle::math::erfinv(Float(dr::clip(2.f * u - 1.f, -.9999999f, .9999999f))) * dr::SqrtTwo<Float>;
        const Float large = dr::maximum(dr::round(expected + dr::sqrt(expected) * z + (z * z - 1.f) / 6.f), 0.f);
        return dr::select(expected > 8.f, large, n);
    }

    // Exact, of one kind: from hit to hit. Back faces are culled, so that each strand counts once.
    Float traced(const Scene *scene, const Ray3f &toward, const BSDFPtr &kind, const Mask &active) const {
        Ray3f start(toward);
        auto [ray, n, going] = dr::while_loop(
            dr::make_tuple(start, Float(0.f), Mask(active)),
            [](const Ray3f &, const Float &, const Mask &going) { return going; },
            [this, scene, &kind](Ray3f &ray, Float &n, Mask &going) {
                // What an instance repeats is known to the whole interaction only.
                const SurfaceInteraction3f si = scene->ray_intersect(ray, +RayFlags::Minimal, false, going);
                const Mask hit = going && si.is_valid();
                if (dr::none_or<false>(hit)) {
                    going = false;
                    return;
                }
                const BSDFPtr bsdf = si.shape->bsdf();
                const Mask hair = hit && is_hair(bsdf);
                dr::masked(n, hair && bsdf == kind) = n + 1.f;
                dr::masked(n, hit && !hair) = -1.f;
                going = hair && n < ScalarFloat(most);
                const Float step = si.t * (1.f + math::RayEpsilon<Float>)+math::RayEpsilon<Float>;
                dr::masked(ray.o, going) = ray(step);
                dr::masked(ray.maxt, going) = ray.maxt - step;
                going &= ray.maxt > 0.f;
            });
        return n;
    }

    std::mutex m_mutex;
    std::atomic<const Scene *> m_scene = nullptr;
    ref<Scene> m_others;
    ScalarBoundingBox3f m_box;  // of all hair
    std::vector<const BSDF *> m_kinds;
    // Some hair is there; all of it is in the grid; some of it knows no mean over what the grid expects.
    bool m_some_hair = false, m_has_grid = false, m_draws = false, m_told = false;
};

NAMESPACE_END(mitsuba)
