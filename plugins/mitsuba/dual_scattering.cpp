// Mitsuba's integrator `dual_scattering`: direct light, with hair lit through hair (Zinke et al. 2008).
//
// For each direction toward a light it finds n, the strands in between, and applies f for n of the strand's BSDF. Emitter
// and BSDF sampling are combined; the BSDF draws from a mixture that needs no n, since n is known only along a direction.
// Whatever is not hair is lit as Mitsuba's `direct` does, and casts shadows on hair.
#include "drjit_traits.h"

#include <mitsuba/core/properties.h>
#include <mitsuba/render/bsdf.h>
#include <mitsuba/render/emitter.h>
#include <mitsuba/render/integrator.h>
#include <mitsuba/render/scene.h>

#include <atomic>
#include <mutex>
#include <sstream>

#include "cuticle/cuticle.h"
#include "hair_grid.h"
#include "strands.h"
#include "variants.h"

NAMESPACE_BEGIN(mitsuba)

template <typename Float, typename Spectrum> class DualScattering final : public SamplingIntegrator<Float, Spectrum> {
  public:
    MI_IMPORT_BASE(SamplingIntegrator, m_hide_emitters)
    MI_IMPORT_TYPES(Scene, Sensor, Sampler, Medium, Shape, ShapePtr, Emitter, EmitterPtr, BSDF, BSDFPtr)

    DualScattering(const Properties &props) : Base(props) {
        const std::string counter = props.get<std::string>("counter", "grid");
        if (counter != "grid" && counter != "trace") Throw("counter must be grid or trace, got %s", counter);
        m_trace = counter == "trace";
        const std::string behind = props.get<std::string>("behind", "counted");
        if (behind != "counted" && behind != "half_space") Throw("behind must be counted or half_space, got %s", behind);
        m_behind = behind == "counted";
        m_cells = whole(props, "cells", 64, 1, 512);
        m_most = whole(props, "max_strands", 64, 1, 10000);
        const int shading = whole(props, "shading_samples", 1, 1, 1024);
        m_emitter_samples = whole(props, "emitter_samples", shading, 0, 1024);
        m_bsdf_samples = whole(props, "bsdf_samples", shading, 0, 1024);
        if (m_emitter_samples + m_bsdf_samples == 0)
            Throw("emitter_samples and bsdf_samples must not both be 0: nothing would be lit");
    }

    TensorXf render(Scene *scene, Sensor *sensor, UInt32 seed, uint32_t spp, bool develop, bool evaluate) override {
        m_scene = nullptr;  // what a scene holds may have changed since
        prepare(scene);
        return Base::render(scene, sensor, seed, spp, develop, evaluate);
    }

    std::pair<Spectrum, Mask> sample(const Scene *scene, Sampler *sampler, const RayDifferential3f &ray, const Medium *,
                                     Float *, Mask active) const override {
        MI_MASKED_FUNCTION(ProfilerPhase::SamplingIntegratorSample, active);
        prepare(scene);
        SurfaceInteraction3f si = scene->ray_intersect(ray, +RayFlags::All, true, active);
        Spectrum result(0.f);
        if (m_hide_emitters) {
            const Mask skip = si.is_valid() && (si.shape->emitter() != nullptr) && active;
            if (dr::any_or<true>(skip)) {
                auto pi = Base::skip_area_emitters(scene, si.spawn_ray(ray.d), true, skip);
                dr::masked(si, skip) = pi.compute_surface_interaction(ray, +RayFlags::All, skip);
            }
        } else {
            const EmitterPtr seen = si.emitter(scene, active);
            if (dr::any_or<true>(seen != nullptr)) result += seen->eval(si, active);
        }
        const Mask valid = active && si.is_valid();
        active &= si.is_valid();
        if (dr::none_or<false>(active)) return {result, valid};

        const BSDFPtr bsdf = si.bsdf(ray);
        const auto flags = bsdf->flags();
        const Mask hair = active && (flags & cuticle_mitsuba::hair_flag) != 0u;
        // What the two techniques' densities are weighted with.
        const ScalarFloat total = ScalarFloat(m_emitter_samples + m_bsdf_samples);
        const ScalarFloat emitter_share = ScalarFloat(m_emitter_samples) / total, bsdf_share = 1 - emitter_share;

        const Mask smooth = active && has_flag(flags, BSDFFlags::Smooth);
        for (int k = 0; k < m_emitter_samples; ++k) {
            auto [ds, light] = scene->sample_emitter_direction(si, sampler->next_2d(smooth), false, smooth);
            Mask lit = smooth && ds.pdf != 0.f;
            if (dr::none_or<false>(lit)) continue;
            const Ray3f toward = si.spawn_ray_to(ds.p);
            const Around around = strands_between(scene, toward, hair, lit, sampler);
            const Vector3f wo = si.to_local(ds.d);
            auto [value, pdf] = eval_pdf(bsdf, si, wo, around, hair, lit);
            value = si.to_world_mueller(value, -wo, si.wi);
            const Float weight = dr::select(ds.delta, Float(1.f), power(ds.pdf * emitter_share, pdf * bsdf_share)) /
                                 ScalarFloat(m_emitter_samples);
            result[lit] += weight * value * light;
        }

        for (int k = 0; k < m_bsdf_samples; ++k) {
            const Float u = sampler->next_1d(active);
            const Point2f u2 = sampler->next_2d(active);
            // On hair f is evaluated once the direction, and with it n, is known: only wo and its pdf are used here.
            auto [bs, value] = draw(bsdf, si, u, u2, hair, active);
            Mask used = active && bs.pdf > 0.f && (hair || dr::any(unpolarized_spectrum(value) != 0.f));
            const Ray3f toward = si.spawn_ray(si.to_world(bs.wo));
            const SurfaceInteraction3f si_light = beyond_hair(scene, toward, hair, used);
            const EmitterPtr emitter = si_light.emitter(scene, used);
            used &= emitter != nullptr;
            if (dr::none_or<false>(used)) continue;
            const Spectrum light = emitter->eval(si_light, used);
            DirectionSample3f ds(scene, si_light, si);
            const Float emitter_pdf =
                dr::select(has_flag(bs.sampled_type, BSDFFlags::Delta), 0.f, scene->pdf_emitter_direction(si, ds, used));
            if (dr::any_or<true>(hair && used)) {
                Ray3f up_to = toward;
                up_to.maxt =
                    dr::select(si_light.is_valid(), si_light.t * (1.f - math::ShadowEpsilon<Float>), dr::Largest<Float>);
                // Beyond the hair nothing stands in the way: beyond_hair found the light itself.
                const Around around = count(scene, up_to, hair && used, sampler);
                const Spectrum f = eval_pdf(bsdf, si, bs.wo, around, hair, hair && used).first;
                value = dr::select(hair, f / bs.pdf, value);
                used &= !hair || around.strands >= 0.f;
            }
            value = si.to_world_mueller(value, -bs.wo, si.wi);
            result[used] +=
                power(bs.pdf * bsdf_share, emitter_pdf * emitter_share) / ScalarFloat(m_bsdf_samples) * value * light;
        }
        return {result, valid};
    }

    std::string to_string() const override {
        std::ostringstream out;
        out << "DualScattering[" << std::endl << "  counter = " << (m_trace ? "trace" : "grid") << "," << std::endl;
        if (m_trace) out << "  max_strands = " << m_most << "," << std::endl;
        else out << "  cells = " << m_cells << "," << std::endl;
        out << "  behind = " << (m_behind ? "counted" : "half_space") << "," << std::endl;
        out << "  emitter_samples = " << m_emitter_samples << "," << std::endl
            << "  bsdf_samples = " << m_bsdf_samples << std::endl
            << "]";
        return out.str();
    }

    MI_DECLARE_CLASS(DualScattering)

  private:
    using Around = cuticle_mitsuba::Around<Float>;

    static int whole(const Properties &props, const char *name, int otherwise, int low, int high) {
        const auto value = props.get<int64_t>(name, otherwise);
        if (value < low || value > high) Throw("%s must be in [%d, %d], got %d", name, low, high, value);
        return int(value);
    }

    static Float power(const Float &a, const Float &b) {
        const Float w = a * a / (a * a + b * b);
        return dr::select(dr::isfinite(w), w, 0.f);
    }

    // Once per scene: its hair's grid, and a scene of everything else.
    void prepare(const Scene *scene) const {
        if (m_scene == scene) return;
        std::lock_guard<std::mutex> guard(m_mutex);
        if (m_scene == scene) return;
        m_others = nullptr;
        Properties others("scene");
        std::vector<ref<Shape>> kept;
        bool some_hair = false, all_read = !m_trace || m_behind;
        m_draws = false;
        for (const ref<Shape> &shape : scene->shapes()) {
            const uint32_t flags = shape->bsdf() ? shape->bsdf()->flags() : 0u;
            if (flags & cuticle_mitsuba::hair_flag) {
                all_read = all_read && m_grid.add(const_cast<Shape *>(shape.get()));
                if (!m_trace && !all_read)
                    Throw(
                        "dual_scattering: hair must be a bsplinecurve for counter = grid, got %s; use bsplinecurve, or "
                        "counter = trace",
                        shape->class_name());
                m_draws = m_draws || !(flags & cuticle_mitsuba::mean_flag);
                some_hair = true;
            } else {
                others.set("shape" + std::to_string(kept.size()), ref<Object>(const_cast<Shape *>(shape.get())));
                kept.push_back(shape);
            }
        }
        if (!some_hair)
            Log(Warn,
                "dual_scattering: no shape has a BSDF `cuticle` whose fibre can stand among others: all is lit as by "
                "`direct`");
        m_has_grid = some_hair && all_read;
        if (m_has_grid) m_grid.build(m_cells);
        else m_grid.clear();
        if (!kept.empty() && some_hair) {
            m_others = new Scene(others);
            // The shapes stay the first scene's.
            for (const ref<Shape> &shape : kept)
                if (shape->is_emitter()) const_cast<Shape *>(shape.get())->emitter()->set_scene(scene);
        }
        m_some_hair = some_hair;
        m_scene = scene;
    }

    // Strands around a hair on its way to the light (elsewhere none); `lit` loses what stands in the shadow of something
    // else.
    Around strands_between(const Scene *scene, const Ray3f &toward, const Mask &hair, Mask &lit, Sampler *sampler) const {
        const Mask on_hair = hair && lit, elsewhere = lit && !hair;
        if (dr::any_or<true>(elsewhere)) lit &= !(elsewhere && scene->ray_test(toward, false, elsewhere));
        if (m_others && !m_trace) lit &= !(on_hair && m_others->ray_test(toward, false, on_hair));
        const Around around = count(scene, toward, on_hair && lit, sampler);
        lit &= around.strands >= 0.f;
        return around;
    }

    // Strands toward the light, -1 where something that is no hair blocks the way (found while tracing only), and beyond.
    Around count(const Scene *scene, const Ray3f &toward, const Mask &active, Sampler *sampler) const {
        Around around{Float(0.f), Float(0.f), Float(cuticle::half_space<Float>)};
        if (!m_some_hair) return around;
        if (m_behind && m_has_grid) around.behind = m_grid.strands_roughly(toward.o, -toward.d, active);
        if (m_trace) {
            around.strands = traced(scene, toward, active);
            return around;
        }
        around.expected = m_grid.strands(toward.o, toward.d, dr::select(active, toward.maxt, 0.f));
        if (m_draws) around.strands = poisson(around.expected, sampler->next_1d(active));
        return around;
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

    // Exact: from hit to hit. Back faces are culled, so that each strand counts once.
    Float traced(const Scene *scene, const Ray3f &toward, const Mask &active) const {
        Ray3f start(toward);
        auto [ray, n, going] = dr::while_loop(
            dr::make_tuple(start, Float(0.f), Mask(active)),
            [](const Ray3f &, const Float &, const Mask &going) { return going; },
            [this, scene](Ray3f &ray, Float &n, Mask &going) {
                const auto pi = scene->ray_intersect_preliminary(ray, false, going);
                const Mask hit = going && pi.is_valid();
                if (dr::none_or<false>(hit)) {
                    going = false;
                    return;
                }
                const BSDFPtr bsdf = pi.shape->bsdf();
                const Mask hair = hit && (bsdf->flags() & cuticle_mitsuba::hair_flag) != 0u;
                dr::masked(n, hair) = n + 1.f;
                dr::masked(n, hit && !hair) = -1.f;
                going = hair && n < ScalarFloat(m_most);
                const Float step = pi.t * (1.f + math::RayEpsilon<Float>)+math::RayEpsilon<Float>;
                dr::masked(ray.o, going) = ray(step);
                dr::masked(ray.maxt, going) = ray.maxt - step;
                going &= ray.maxt > 0.f;
            });
        return n;
    }

    // The first thing along a ray that is not hair, for rays that start on hair; the first thing for all others.
    SurfaceInteraction3f beyond_hair(const Scene *scene, const Ray3f &ray, const Mask &hair, const Mask &active) const {
        SurfaceInteraction3f si = dr::zeros<SurfaceInteraction3f>();
        si.wi = -ray.d;
        si.time = ray.time;
        si.wavelengths = ray.wavelengths;
        si.t = dr::Infinity<Float>;
        const Mask on_hair = active && hair, elsewhere = active && !hair;
        if (m_others && dr::any_or<true>(on_hair)) {
            const SurfaceInteraction3f found = m_others->ray_intersect(ray, +RayFlags::All, false, on_hair);
            dr::masked(si, on_hair) = found;
        }
        if (dr::any_or<true>(elsewhere)) {
            const SurfaceInteraction3f found = scene->ray_intersect(ray, +RayFlags::All, false, elsewhere);
            dr::masked(si, elsewhere) = found;
        }
        return si;
    }

    std::pair<Spectrum, Float> eval_pdf(const BSDFPtr &bsdf, const SurfaceInteraction3f &si, const Vector3f &wo,
                                        const Around &around, const Mask &hair, const Mask &active) const {
        Spectrum value(0.f);
        Float pdf(0.f);
        const Mask on_hair = active && hair, elsewhere = active && !hair;
        if (dr::any_or<true>(on_hair)) {
            SurfaceInteraction3f si_n(si);
            cuticle_mitsuba::set_around(si_n, around);
            const auto context = cuticle_mitsuba::among_strands_context(m_trace ? 0u : cuticle_mitsuba::expected_bit);
            const auto [v, p] = bsdf->eval_pdf(context, si_n, wo, on_hair);
            value = dr::select(on_hair, v, value);
            pdf = dr::select(on_hair, p, pdf);
        }
        if (dr::any_or<true>(elsewhere)) {
            const auto [v, p] = bsdf->eval_pdf(BSDFContext(), si, wo, elsewhere);
            value = dr::select(elsewhere, v, value);
            pdf = dr::select(elsewhere, p, pdf);
        }
        return {value, pdf};
    }

    std::pair<BSDFSample3f, Spectrum> draw(const BSDFPtr &bsdf, const SurfaceInteraction3f &si, const Float &u,
                                           const Point2f &u2, const Mask &hair, const Mask &active) const {
        BSDFSample3f sample = dr::zeros<BSDFSample3f>();
        Spectrum value(0.f);
        const Mask on_hair = active && hair, elsewhere = active && !hair;
        if (dr::any_or<true>(on_hair)) {
            const auto [s, v] = bsdf->sample(cuticle_mitsuba::among_strands_context(cuticle_mitsuba::direction_only_bit), si,
                                             u, u2, on_hair);
            dr::masked(sample, on_hair) = s;
        }
        if (dr::any_or<true>(elsewhere)) {
            const auto [s, v] = bsdf->sample(BSDFContext(), si, u, u2, elsewhere);
            dr::masked(sample, elsewhere) = s;
            value = dr::select(elsewhere, v, value);
        }
        return {sample, value};
    }

    bool m_trace, m_behind;
    int m_cells, m_most, m_emitter_samples, m_bsdf_samples;
    mutable std::mutex m_mutex;
    mutable std::atomic<const Scene *> m_scene = nullptr;
    mutable cuticle_mitsuba::HairGrid<Float> m_grid;
    mutable ref<Scene> m_others;
    // Some hair is there; all of it is in the grid; some of it knows no mean over what the grid expects.
    mutable bool m_some_hair = false, m_has_grid = false, m_draws = false;

    MI_TRAVERSE_CB(Base, m_grid.m_values, m_grid.m_rough_values)
};

CUTICLE_EXPORT_PLUGIN(DualScattering)

NAMESPACE_END(mitsuba)
