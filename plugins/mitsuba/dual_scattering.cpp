// Mitsuba's integrator `dual_scattering`: direct light, with hair lit through hair (Zinke et al. 2008), as bright as paths.
//
// For each direction toward a light it finds n, the strands in between, and applies f for n of the strand's BSDF. Emitter
// and BSDF sampling are combined; the BSDF draws from a mixture that needs no n, since n is known only along a direction.
// Whatever is not hair is lit as Mitsuba's `direct` does, through hair too, and casts shadows on hair.
//
// Light on crooked ways is not in f. Either a coarse pass of paths tells by how much they are brighter, in each region
// (brightness.h), or `bounces` segments are traced as a path, and dual scattering lights its last vertex only.
#include "drjit_traits.h"

#include <mitsuba/core/plugin.h>
#include <mitsuba/core/properties.h>
#include <mitsuba/core/random.h>
#include <mitsuba/render/bsdf.h>
#include <mitsuba/render/emitter.h>
#include <mitsuba/render/film.h>
#include <mitsuba/render/integrator.h>
#include <mitsuba/render/sampler.h>
#include <mitsuba/render/scene.h>
#include <mitsuba/render/sensor.h>

#include <nanothread/nanothread.h>

#include <algorithm>
#include <sstream>

#include "brightness.h"
#include "cuticle/cuticle.h"
#include "light_through_hair.h"
#include "technique_chances.h"
#include "variants.h"

NAMESPACE_BEGIN(mitsuba)

template <typename Float, typename Spectrum> class DualScattering final : public SamplingIntegrator<Float, Spectrum> {
  public:
    MI_IMPORT_BASE(SamplingIntegrator, m_hide_emitters)
    MI_IMPORT_TYPES(Scene, Sensor, Sampler, Medium, EmitterPtr, BSDFPtr)

    DualScattering(const Properties &props) : Base(props) {
        const std::string counter = props.get<std::string>("counter", "grid");
        if (counter != "grid" && counter != "trace") Throw("counter must be grid or trace, got %s", counter);
        m_light.around.trace = counter == "trace";
        const std::string behind = props.get<std::string>("behind", "counted");
        if (behind != "counted" && behind != "half_space") Throw("behind must be counted or half_space, got %s", behind);
        m_light.around.behind = behind == "counted";
        m_light.around.cells = whole(props, "cells", 64, 1, 512);
        m_light.around.most = whole(props, "max_strands", 64, 1, 10000);
        const int shading = whole(props, "shading_samples", 1, 1, 1024);
        m_emitter_samples = whole(props, "emitter_samples", shading, 0, 1024);
        m_bsdf_samples = whole(props, "bsdf_samples", shading, 0, 1024);
        m_choose = !props.has_property("shading_samples") && !props.has_property("emitter_samples") &&
                   !props.has_property("bsdf_samples");
        m_bounces = whole(props, "bounces", 0, 0, 1000);
        m_paths = whole(props, "correction_paths", m_bounces > 0 ? 0 : -1, -1, 1 << 24);
        if (m_bounces > 0 && m_paths != 0)
            Throw("correction_paths must be 0 with bounces: they correct what is seen of dual scattering; got %d", m_paths);
        if (m_emitter_samples + m_bsdf_samples == 0)
            Throw("emitter_samples and bsdf_samples must not both be 0: nothing would be lit");
    }

    TensorXf render(Scene *scene, Sensor *sensor, UInt32 seed, uint32_t spp, bool develop, bool evaluate) override {
        m_light.around.forget();
        m_light.around.prepare(scene);
        compare(scene, sensor, seed, spp);
        return Base::render(scene, sensor, seed, spp, develop, evaluate);
    }

    std::pair<Spectrum, Mask> sample(const Scene *scene, Sampler *sampler, const RayDifferential3f &ray, const Medium *,
                                     Float *, Mask active) const override {
        MI_MASKED_FUNCTION(ProfilerPhase::SamplingIntegratorSample, active);
        m_light.around.prepare(scene);
        auto [path, si] = trace(scene, sampler, ray, m_bounces, active);
        Spectrum last = lit(scene, sampler, si, path);
        if (m_ratio.known() && dr::any_or<true>(path.going)) {
            const Mask hair = path.going && m_light.around.is_hair(si.bsdf(path.ray));
            last[hair] *= ratio(si.p, hair);
        }
        path.result[path.going] += path.throughput * last;
        return {path.result, path.seen};
    }

    std::string to_string() const override {
        std::ostringstream out;
        out << "DualScattering[" << std::endl
            << "  counter = " << (m_light.around.trace ? "trace" : "grid") << "," << std::endl;
        if (m_light.around.trace) out << "  max_strands = " << m_light.around.most << "," << std::endl;
        else out << "  cells = " << m_light.around.cells << "," << std::endl;
        out << "  bounces = " << m_bounces << "," << std::endl << "  correction_paths = ";
        if (m_paths < 0) out << "by the picture's size," << std::endl;
        else out << m_paths << "," << std::endl;
        out << "  behind = " << (m_light.around.behind ? "counted" : "half_space") << "," << std::endl;
        const auto samples = [&](int fixed, float chance) {
            if (!m_choose) out << fixed;
            else if (m_chances_known) out << chance << ", by the scene's light";
            else out << "by the scene's light";
        };
        out << "  emitter_samples = ";
        samples(m_emitter_samples, m_chances.emitter);
        out << "," << std::endl << "  bsdf_samples = ";
        samples(m_bsdf_samples, m_chances.bsdf);
        out << std::endl << "]";
        return out.str();
    }

    MI_DECLARE_CLASS(DualScattering)

  private:
    using Lit = typename LightThroughHair<Float, Spectrum>::Lit;
    // A spectrum's three colours or, where its wavelengths are a ray's own, their mean.
    static constexpr size_t channels = is_rgb_v<Spectrum> ? 3 : 1;
    using Ratio = cuticle_mitsuba::BrightnessRatio<Float, channels>;
    using Colours = std::array<Float, channels>;
    using TechniqueChoice = cuticle_mitsuba::TechniqueChoice;

    // From the sensor to where `ray` leads: `length` segments so far, and the sum of the light that they have met. `ray`
    // left `from`, in a direction drawn with the density pdf; none for the sensor's own.
    struct Path {
        Ray3f ray;
        Spectrum throughput, result;
        Interaction3f from;
        Float pdf;
        UInt32 length;
        Mask going, seen, delta;
        Sampler *sampler;

        DRJIT_STRUCT(Path, ray, throughput, result, from, pdf, length, going, seen, delta, sampler)
    };

    // A path of up to so many bounces, and where it ends.
    std::pair<Path, SurfaceInteraction3f> trace(const Scene *scene, Sampler *sampler, const Ray3f &ray, int bounces,
                                                const Mask &active) const {
        Path start = dr::zeros<Path>();
        start.ray = ray;
        start.throughput = 1.f;
        start.going = active;
        start.sampler = sampler;
        auto [path] = dr::while_loop(
            dr::make_tuple(start), [bounces](const Path &path) { return path.going && path.length < uint32_t(bounces); },
            [this, scene](Path &path) { bounce(scene, path); }, "bounces");
        const SurfaceInteraction3f si = arrive(scene, path);
        return {path, si};
    }

    // What rays of the sensor that meet hair have found.
    struct Found {
        std::vector<typename Ratio::Sample> samples;
        TechniqueChoice choice;
    };

    // Before the picture: what paths are brighter by than dual scattering where rays of the sensor meet hair, and which
    // technique finds its light.
    void compare(Scene *scene, Sensor *sensor, const UInt32 &seed, uint32_t spp) {
        m_ratio.forget();
        m_chances_known = false;
        const bool paths = m_bounces == 0 && m_paths != 0;
        if (!m_light.around.some_hair() || !(paths || m_choose)) return;
        const dr::suspend_grad<Float> still;
        const auto size = sensor->film()->crop_size();
        const uint64_t samples = uint64_t(size.x()) * size.y() * (spp ? spp : sensor->sampler()->sample_count());
        // Unless the scene says how many: until they know the brightness to 1 %, at most one for 16 samples of the picture.
        // They are kept in memory, some 150 MB at most. Where no light comes to hair they never know.
        uint64_t most = std::clamp<uint64_t>(samples / 16, 1 << 12, 1 << 22);
        if (!paths) most = 1 << 12;
        else if (m_paths > 0) most = uint64_t(m_paths);
        // Traced arrays take a round's rays at once, scalar code a block of them for each task.
        constexpr bool wide = dr::is_jit_v<Float>;
        Found found;
        for (uint64_t done = 0; done < most && (m_paths > 0 || !(Ratio::error(found.samples) <= .01));) {
            const uint32_t count = uint32_t(std::min<uint64_t>(most - done, wide ? 1 << 16 : 1 << 12));
            const uint32_t block = wide ? count : 64, blocks = (count + block - 1) / block;
            std::vector<Found> parts(blocks);
            const auto part = [&](uint32_t k) {
                ref<Sampler> sampler = PluginManager::instance()->create_object<Sampler>(Properties("independent"));
                sampler->seed(sample_tea_32<UInt32>(seed, UInt32(uint32_t(done) + k)).first, block);
                for (uint32_t ray = 0; ray < (wide ? 1 : block); ++ray)
                    collect(scene, sensor, sampler.get(), paths, parts[k]);
            };
            if constexpr (wide) part(0);
            else
                dr::parallel_for(dr::blocked_range<uint32_t>(0, blocks), [&](const auto &range) {
                    for (const uint32_t k : range) part(k);
                });
            for (const Found &part : parts) {
                found.samples.insert(found.samples.end(), part.samples.begin(), part.samples.end());
                found.choice += part.choice;
            }
            done += count;
        }
        if (paths) m_ratio.measure(found.samples, m_light.around.box());
        if (m_choose) {
            m_chances = found.choice.best(wide);
            m_chances_known = true;
        }
    }

    // Along a ray of the sensor that meets hair: dual scattering's light and, with `paths`, a path's.
    void collect(const Scene *scene, const Sensor *sensor, Sampler *sampler, bool paths, Found &found) const {
        const Float time = sensor->shutter_open() + sensor->shutter_open_time() * sampler->next_1d();
        const Float wavelength = sampler->next_1d();
        const Point2f position = sampler->next_2d();
        const auto [ray, weight] = sensor->sample_ray(time, wavelength, position, sampler->next_2d());
        auto [none, si] = trace(scene, sampler, ray, 0, true);
        Mask hair = none.going;
        if (dr::none_or<false>(hair)) return;
        const BSDFPtr bsdf = si.bsdf(ray);
        hair &= m_light.around.is_hair(bsdf);
        if (dr::none_or<false>(hair)) return;
        const Lit of_emitter = m_light.toward_emitter(scene, sampler, si, bsdf, hair, true, hair && m_emitter_samples > 0),
                  of_bsdf = m_light.as_bsdf_draws(scene, sampler, si, bsdf, hair, true, hair && m_bsdf_samples > 0);
        const auto both = [&](float emitters, float bsdfs) {
            return std::pair(of_emitter.weighed(emitters, bsdfs), of_bsdf.weighed(emitters, bsdfs));
        };
        std::array<Float, TechniqueChoice::choices.size()> squares;
        for (size_t k = 0; k < squares.size(); ++k) {
            const auto [p, q] = TechniqueChoice::choices[k];
            const auto [first, second] = both(p, q);
            const Float a = brightness(first), b = brightness(second);
            squares[k] = dr::select(hair, p * a * a + q * b * b + 2 * p * q * a * b, 0.f);
        }
        Colours full{}, dual{};
        if (paths) {
            const auto [first, second] = both(tries(m_emitter_samples), tries(m_bsdf_samples));
            auto [path, end] = trace(scene, sampler, ray, path_bounces, hair);
            const Spectrum rest = path.throughput * lit(scene, sampler, end, path);
            full = colours(unpolarized_spectrum(weight * (path.result + dr::select(path.going, rest, 0.f))));
            dual = colours(unpolarized_spectrum(weight * (first + second)));
        }
        if constexpr (dr::is_jit_v<Float>) {  // one kernel for all of it
            for (const Float &x : squares) dr::schedule(x);
            for (size_t c = 0; c < channels; ++c) dr::schedule(full[c], dual[c]);
            dr::schedule(hair, si.p);
            dr::eval();
        }
        for (size_t k = 0; k < squares.size(); ++k) found.choice.squares[k] += total(squares[k]);
        if (paths) Ratio::collect(hair, si.p, full, dual, found.samples);
    }

    static Float brightness(const Spectrum &s) { return dr::mean(unpolarized_spectrum(s)); }
    static double total(const Float &x) {
        if constexpr (dr::is_jit_v<Float>) {
            const auto sum = dr::migrate(dr::detach(dr::sum(x)), JitBackend::None);
            dr::sync_thread();
            return double(sum[0]);
        } else {
            return double(x);
        }
    }

    static Colours colours(const UnpolarizedSpectrum &s) {
        if constexpr (channels == 3) return {s[0], s[1], s[2]};
        else return {dr::mean(s)};
    }
    UnpolarizedSpectrum ratio(const Point3f &p, const Mask &active) const {
        const auto r = m_ratio.at(p, active);
        if constexpr (channels == 3) return {r[0], r[1], r[2]};
        else return r[0];
    }

    // Where the path's ray leads, and the light of what shines there, which an emitter sample may have met as well.
    SurfaceInteraction3f arrive(const Scene *scene, Path &path) const {
        if (dr::none_or<false>(path.going)) return dr::zeros<SurfaceInteraction3f>();
        SurfaceInteraction3f si = scene->ray_intersect(path.ray, +RayFlags::All, true, path.going);
        const Mask first = path.going && path.length == 0u;
        if (m_hide_emitters) {
            const Mask skip = first && si.is_valid() && si.shape->emitter() != nullptr;
            if (dr::any_or<true>(skip)) {
                auto pi = Base::skip_area_emitters(scene, si.spawn_ray(path.ray.d), true, skip);
                dr::masked(si, skip) = pi.compute_surface_interaction(path.ray, +RayFlags::All, skip);
            }
        }
        path.seen |= first && si.is_valid();
        const EmitterPtr seen = si.emitter(scene, path.going);
        const Mask shines = path.going && seen != nullptr && !(m_hide_emitters && first);
        if (dr::any_or<true>(shines)) {
            const DirectionSample3f ds(scene, si, path.from);
            const Float met =
                dr::select(path.delta || first, 0.f, scene->pdf_emitter_direction(path.from, ds, shines && !first));
            const Float weight =
                dr::select(first, 1.f, power(path.pdf * tries(m_bsdf_samples), met * tries(m_emitter_samples)));
            path.result[shines] += path.throughput * weight * seen->eval(si, shines);
        }
        path.going &= si.is_valid();
        return si;
    }

    // Of a technique at a path's vertex: one, unless the scene wants none of its samples.
    static float tries(int samples) { return samples > 0 ? 1.f : 0.f; }

    // A segment of a path of single scattering: the light that nothing blocks, and the direction on.
    void bounce(const Scene *scene, Path &path) const {
        SurfaceInteraction3f si = arrive(scene, path);
        if (dr::none_or<false>(path.going)) return;
        const BSDFPtr bsdf = si.bsdf(path.ray);
        const BSDFContext context;
        const Mask smooth = path.going && has_flag(bsdf->flags(), BSDFFlags::Smooth) && m_emitter_samples > 0;
        if (dr::any_or<true>(smooth)) {
            auto [ds, light] = scene->sample_emitter_direction(si, path.sampler->next_2d(smooth), true, smooth);
            const Mask lit = smooth && ds.pdf != 0.f;
            const Vector3f wo = si.to_local(ds.d);
            auto [value, pdf] = bsdf->eval_pdf(context, si, wo, lit);
            value = si.to_world_mueller(value, -wo, si.wi);
            const Float weight = dr::select(ds.delta, 1.f, power(ds.pdf, pdf * tries(m_bsdf_samples)));
            path.result[lit] += path.throughput * weight * value * light;
        }
        const Float u = path.sampler->next_1d(path.going);
        auto [bs, value] = bsdf->sample(context, si, u, path.sampler->next_2d(path.going), path.going);
        path.throughput *= si.to_world_mueller(value, -bs.wo, si.wi);
        path.going &= dr::any(unpolarized_spectrum(path.throughput) != 0.f);
        path.ray = si.spawn_ray(si.to_world(bs.wo));
        path.from = si;
        path.pdf = bs.pdf;
        path.delta = has_flag(bs.sampled_type, BSDFFlags::Delta);
        path.length += 1u;
    }

    // Light from emitters that a surface scatters; on hair, through hair.
    Spectrum lit(const Scene *scene, Sampler *sampler, SurfaceInteraction3f &si, const Path &path) const {
        const Mask &active = path.going;
        Spectrum result(0.f);
        if (dr::none_or<false>(active)) return result;
        const BSDFPtr bsdf = si.bsdf(path.ray);
        const Mask hair = active && m_light.around.is_hair(bsdf), seen = path.length == 0u;
        Mask try_emitter = active, try_bsdf = active;
        Float emitters = ScalarFloat(m_emitter_samples), bsdfs = ScalarFloat(m_bsdf_samples);
        if (m_chances_known) {
            emitters = dr::select(hair, Float(m_chances.emitter), emitters);
            bsdfs = dr::select(hair, Float(m_chances.bsdf), bsdfs);
            try_emitter &= sampler->next_1d(active) < emitters;
            try_bsdf &= sampler->next_1d(active) < bsdfs;
        }
        for (int k = 0; k < m_emitter_samples; ++k)
            result += m_light.toward_emitter(scene, sampler, si, bsdf, hair, seen, try_emitter).weighed(emitters, bsdfs);
        for (int k = 0; k < m_bsdf_samples; ++k)
            result += m_light.as_bsdf_draws(scene, sampler, si, bsdf, hair, seen, try_bsdf).weighed(emitters, bsdfs);
        return result;
    }

    static int whole(const Properties &props, const char *name, int otherwise, int low, int high) {
        const auto value = props.get<int64_t>(name, otherwise);
        if (value < low || value > high) Throw("%s must be in [%d, %d], got %d", name, low, high, value);
        return int(value);
    }

    static Float power(const Float &a, const Float &b) {
        const Float w = a * a / (a * a + b * b);
        return dr::select(dr::isfinite(w), w, 0.f);
    }

    static constexpr int path_bounces = 8;  // of the paths that dual scattering is compared with; it lights their ends
    int m_bounces, m_emitter_samples, m_bsdf_samples;
    int64_t m_paths;                         // of these; by the picture's size where negative
    bool m_choose, m_chances_known = false;  // hair's techniques are used with chances
    cuticle_mitsuba::TechniqueChances m_chances;
    Ratio m_ratio;
    LightThroughHair<Float, Spectrum> m_light;

    MI_TRAVERSE_CB(Base, m_light.around.grid.m_values, m_light.around.grid.m_rough_values)
};

CUTICLE_EXPORT_PLUGIN(DualScattering)

NAMESPACE_END(mitsuba)
