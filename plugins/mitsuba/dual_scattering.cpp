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

#include <sstream>

#include "brightness.h"
#include "cuticle/cuticle.h"
#include "strands.h"
#include "strands_around.h"
#include "variants.h"

NAMESPACE_BEGIN(mitsuba)

template <typename Float, typename Spectrum> class DualScattering final : public SamplingIntegrator<Float, Spectrum> {
  public:
    MI_IMPORT_BASE(SamplingIntegrator, m_hide_emitters)
    MI_IMPORT_TYPES(Scene, Sensor, Film, Sampler, Medium, Shape, ShapePtr, Emitter, EmitterPtr, BSDF, BSDFPtr)

    DualScattering(const Properties &props) : Base(props) {
        const std::string counter = props.get<std::string>("counter", "grid");
        if (counter != "grid" && counter != "trace") Throw("counter must be grid or trace, got %s", counter);
        m_around.trace = counter == "trace";
        const std::string behind = props.get<std::string>("behind", "counted");
        if (behind != "counted" && behind != "half_space") Throw("behind must be counted or half_space, got %s", behind);
        m_around.behind = behind == "counted";
        m_around.cells = whole(props, "cells", 64, 1, 512);
        m_around.most = whole(props, "max_strands", 64, 1, 10000);
        const int shading = whole(props, "shading_samples", 1, 1, 1024);
        m_emitter_samples = whole(props, "emitter_samples", shading, 0, 1024);
        m_bsdf_samples = whole(props, "bsdf_samples", shading, 0, 1024);
        m_bounces = whole(props, "bounces", 0, 0, 1000);
        m_paths = whole(props, "correction_paths", m_bounces > 0 ? 0 : -1, -1, 1 << 24);
        if (m_bounces > 0 && m_paths != 0)
            Throw("correction_paths must be 0 with bounces: they correct what is seen of dual scattering; got %d", m_paths);
        if (m_emitter_samples + m_bsdf_samples == 0)
            Throw("emitter_samples and bsdf_samples must not both be 0: nothing would be lit");
    }

    TensorXf render(Scene *scene, Sensor *sensor, UInt32 seed, uint32_t spp, bool develop, bool evaluate) override {
        m_around.forget();
        m_around.prepare(scene);
        compare(scene, sensor, seed, spp);
        return Base::render(scene, sensor, seed, spp, develop, evaluate);
    }

    std::pair<Spectrum, Mask> sample(const Scene *scene, Sampler *sampler, const RayDifferential3f &ray, const Medium *,
                                     Float *, Mask active) const override {
        MI_MASKED_FUNCTION(ProfilerPhase::SamplingIntegratorSample, active);
        m_around.prepare(scene);
        auto [path, si] = trace(scene, sampler, ray, m_bounces, active);
        Spectrum last = lit(scene, sampler, si, path);
        if (m_ratio.known() && dr::any_or<true>(path.going)) {
            const Mask hair = path.going && m_around.is_hair(si.bsdf(path.ray));
            last[hair] *= ratio(si.p, hair);
        }
        path.result[path.going] += path.throughput * last;
        return {path.result, path.seen};
    }

    std::string to_string() const override {
        std::ostringstream out;
        out << "DualScattering[" << std::endl << "  counter = " << (m_around.trace ? "trace" : "grid") << "," << std::endl;
        if (m_around.trace) out << "  max_strands = " << m_around.most << "," << std::endl;
        else out << "  cells = " << m_around.cells << "," << std::endl;
        out << "  bounces = " << m_bounces << "," << std::endl << "  correction_paths = ";
        if (m_paths < 0) out << "by the picture's size," << std::endl;
        else out << m_paths << "," << std::endl;
        out << "  behind = " << (m_around.behind ? "counted" : "half_space") << "," << std::endl;
        out << "  emitter_samples = " << m_emitter_samples << "," << std::endl
            << "  bsdf_samples = " << m_bsdf_samples << std::endl
            << "]";
        return out.str();
    }

    MI_DECLARE_CLASS(DualScattering)

  private:
    using Around = typename StrandsAround<Float, Spectrum>::Around;
    // A spectrum's three colours or, where its wavelengths are a ray's own, their mean.
    static constexpr size_t channels = is_rgb_v<Spectrum> ? 3 : 1;
    using Ratio = cuticle_mitsuba::BrightnessRatio<Float, channels>;
    using Colours = std::array<Float, channels>;

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

    // What paths from the sensor are brighter by than dual scattering where they meet hair.
    void compare(Scene *scene, Sensor *sensor, const UInt32 &seed, uint32_t spp) {
        m_ratio.forget();
        if (!m_around.some_hair() || m_bounces > 0 || m_paths == 0) return;
        const dr::suspend_grad<Float> still;
        const auto size = sensor->film()->crop_size();
        const uint64_t samples = uint64_t(size.x()) * size.y() * (spp ? spp : sensor->sampler()->sample_count());
        // Unless the scene says how many: until they know the brightness to 1 %, at most one for 16 samples of the picture.
        const uint64_t most = m_paths > 0 ? uint64_t(m_paths) : std::max<uint64_t>(samples / 16, 1 << 12);
        // Traced arrays take a round's rays at once, scalar code a block of them for each task.
        constexpr bool wide = dr::is_jit_v<Float>;
        std::vector<typename Ratio::Sample> found;
        for (uint64_t done = 0; done < most && (m_paths > 0 || !(Ratio::error(found) <= .01));) {
            const uint32_t count = uint32_t(std::min<uint64_t>(most - done, wide ? 1 << 16 : 1 << 12));
            const uint32_t block = wide ? count : 64, blocks = (count + block - 1) / block;
            std::vector<std::vector<typename Ratio::Sample>> parts(blocks);
            const auto part = [&](uint32_t k) {
                ref<Sampler> sampler = PluginManager::instance()->create_object<Sampler>(Properties("independent"));
                sampler->seed(sample_tea_32<UInt32>(seed, UInt32(uint32_t(done) + k)).first, block);
                for (uint32_t ray = 0; ray < (wide ? 1 : block); ++ray) collect(scene, sensor, sampler.get(), parts[k]);
            };
            if constexpr (wide) part(0);
            else
                dr::parallel_for(dr::blocked_range<uint32_t>(0, blocks), [&](const auto &range) {
                    for (const uint32_t k : range) part(k);
                });
            for (const auto &samples : parts) found.insert(found.end(), samples.begin(), samples.end());
            done += count;
        }
        m_ratio.measure(found, m_around.box());
    }

    // The light of a path and of dual scattering along the same ray of the sensor, where it meets hair.
    void collect(const Scene *scene, const Sensor *sensor, Sampler *sampler,
                 std::vector<typename Ratio::Sample> &found) const {
        const Float time = sensor->shutter_open() + sensor->shutter_open_time() * sampler->next_1d();
        const Float wavelength = sampler->next_1d();
        const Point2f position = sampler->next_2d();
        const auto [ray, weight] = sensor->sample_ray(time, wavelength, position, sampler->next_2d());
        auto [none, si] = trace(scene, sampler, ray, 0, true);
        Mask hair = none.going;
        if (dr::none_or<false>(hair)) return;
        hair &= m_around.is_hair(si.bsdf(ray));
        if (dr::none_or<false>(hair)) return;
        // Paths cost several times as much.
        Spectrum sum(0.f);
        for (int k = 0; k < 4; ++k) sum += lit(scene, sampler, si, none);
        const Colours dual = colours(unpolarized_spectrum(weight * sum * .25f));
        auto [path, end] = trace(scene, sampler, ray, path_bounces, hair);
        const Spectrum rest = path.throughput * lit(scene, sampler, end, path);
        const Colours full = colours(unpolarized_spectrum(weight * (path.result + dr::select(path.going, rest, 0.f))));
        Ratio::collect(hair, si.p, full, dual, found);
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
        path.seen |= first && si.is_valid();
        if (m_hide_emitters) {
            const Mask skip = first && si.is_valid() && si.shape->emitter() != nullptr;
            if (dr::any_or<true>(skip)) {
                auto pi = Base::skip_area_emitters(scene, si.spawn_ray(path.ray.d), true, skip);
                dr::masked(si, skip) = pi.compute_surface_interaction(path.ray, +RayFlags::All, skip);
            }
        }
        const EmitterPtr seen = si.emitter(scene, path.going);
        const Mask shines = path.going && seen != nullptr && !(m_hide_emitters && first);
        if (dr::any_or<true>(shines)) {
            const DirectionSample3f ds(scene, si, path.from);
            const Float met =
                dr::select(path.delta || first, 0.f, scene->pdf_emitter_direction(path.from, ds, shines && !first));
            const Float weight = dr::select(first, 1.f, power(path.pdf * bounce_share(1), met * bounce_share(0)));
            path.result[shines] += path.throughput * weight * seen->eval(si, shines);
        }
        path.going &= si.is_valid();
        return si;
    }

    // A path has one sample of each technique at a vertex, unless the scene wants none of it.
    ScalarFloat bounce_share(int technique) const {
        return (technique == 0 ? m_emitter_samples : m_bsdf_samples) > 0 ? ScalarFloat(1) : ScalarFloat(0);
    }

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
            const Float weight = dr::select(ds.delta, 1.f, power(ds.pdf, pdf * bounce_share(1)));
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
        const auto flags = bsdf->flags();
        const Mask hair = active && (flags & cuticle_mitsuba::hair_flag) != 0u, seen = path.length == 0u;
        // What the two techniques' densities are weighted with.
        const ScalarFloat total = ScalarFloat(m_emitter_samples + m_bsdf_samples);
        const ScalarFloat emitter_share = ScalarFloat(m_emitter_samples) / total, bsdf_share = 1 - emitter_share;

        const Mask smooth = active && has_flag(flags, BSDFFlags::Smooth);
        for (int k = 0; k < m_emitter_samples; ++k) {
            auto [ds, light] = scene->sample_emitter_direction(si, sampler->next_2d(smooth), false, smooth);
            Mask lit = smooth && ds.pdf != 0.f;
            if (dr::none_or<false>(lit)) continue;
            const Ray3f toward = si.spawn_ray_to(ds.p);
            const Around around = m_around.strands_between(scene, toward, hair, seen, lit, sampler);
            const Vector3f wo = si.to_local(ds.d);
            auto [value, pdf] = eval_pdf(bsdf, si, wo, around, hair, lit);
            value = si.to_world_mueller(value, -wo, si.wi) * m_around.transmittance(scene, toward, lit && !hair, sampler);
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
            // A mirror shows the hair itself.
            const Mask sharp = has_flag(bs.sampled_type, BSDFFlags::Delta);
            const SurfaceInteraction3f si_light = m_around.beyond_hair(scene, toward, !sharp, used);
            const EmitterPtr emitter = si_light.emitter(scene, used);
            used &= emitter != nullptr;
            if (dr::none_or<false>(used)) continue;
            const Spectrum light = emitter->eval(si_light, used);
            DirectionSample3f ds(scene, si_light, si);
            const Float emitter_pdf = dr::select(sharp, 0.f, scene->pdf_emitter_direction(si, ds, used));
            Ray3f up_to = toward;
            up_to.maxt =
                dr::select(si_light.is_valid(), si_light.t * (1.f - math::ShadowEpsilon<Float>), dr::Largest<Float>);
            value *= m_around.transmittance(scene, up_to, used && !hair && !sharp, sampler);
            if (dr::any_or<true>(hair && used)) {
                // Beyond the hair nothing stands in the way: beyond_hair found the light itself.
                const Around around = m_around.count(scene, up_to, seen, hair && used, sampler);
                const Spectrum f = eval_pdf(bsdf, si, bs.wo, around, hair, hair && used).first;
                value = dr::select(hair, f / bs.pdf, value);
                used &= !hair || around.strands >= 0.f;
            }
            value = si.to_world_mueller(value, -bs.wo, si.wi);
            result[used] +=
                power(bs.pdf * bsdf_share, emitter_pdf * emitter_share) / ScalarFloat(m_bsdf_samples) * value * light;
        }
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

    std::pair<Spectrum, Float> eval_pdf(const BSDFPtr &bsdf, const SurfaceInteraction3f &si, const Vector3f &wo,
                                        const Around &around, const Mask &hair, const Mask &active) const {
        Spectrum value(0.f);
        Float pdf(0.f);
        const Mask on_hair = active && hair, elsewhere = active && !hair;
        if (dr::any_or<true>(on_hair)) {
            SurfaceInteraction3f si_n(si);
            cuticle_mitsuba::set_around(si_n, around);
            const auto context = cuticle_mitsuba::among_strands_context(m_around.trace ? 0u : cuticle_mitsuba::expected_bit);
            const auto [v, p] = bsdf->eval_pdf(context, si_n, wo, on_hair);
            value = dr::select(on_hair, v * m_around.other_kinds(bsdf, si, wo, around, on_hair), value);
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

    static constexpr int path_bounces = 16;  // of the paths that dual scattering is compared with
    int m_bounces, m_emitter_samples, m_bsdf_samples;
    int64_t m_paths;  // of these; by the picture's size where negative
    Ratio m_ratio;
    mutable StrandsAround<Float, Spectrum> m_around;

    MI_TRAVERSE_CB(Base, m_around.grid.m_values, m_around.grid.m_rough_values)
};

CUTICLE_EXPORT_PLUGIN(DualScattering)

NAMESPACE_END(mitsuba)
