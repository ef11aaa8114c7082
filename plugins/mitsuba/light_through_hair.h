// Light from one direction that a surface scatters; on hair, through hair: a direction toward an emitter, or as a BSDF
// draws.
#pragma once

#include "drjit_traits.h"

#include <mitsuba/render/bsdf.h>
#include <mitsuba/render/emitter.h>
#include <mitsuba/render/sampler.h>
#include <mitsuba/render/scene.h>

#include <utility>

#include "strands.h"
#include "strands_around.h"

NAMESPACE_BEGIN(mitsuba)

template <typename Float, typename Spectrum> class LightThroughHair {
  public:
    MI_IMPORT_TYPES(Scene, Sampler, EmitterPtr, BSDFPtr)

    mutable StrandsAround<Float, Spectrum> around;

    // Light that a surface scatters from a direction, and the densities with which both techniques draw that direction.
    struct Lit {
        Spectrum light{0.f};
        Float by_emitter{0.f}, by_bsdf{0.f};

        // Where so many directions of each technique are used: the balance heuristic.
        Spectrum weighed(const Float &emitters, const Float &bsdfs) const {
            const Float density = emitters * by_emitter + bsdfs * by_bsdf;
            return light * dr::select(density > 0.f, 1.f / density, 0.f);
        }
    };

    Lit toward_emitter(const Scene *scene, Sampler *sampler, SurfaceInteraction3f &si, const BSDFPtr &bsdf, const Mask &hair,
                       const Mask &seen, const Mask &active) const {
        Lit lit;
        const Mask smooth = active && has_flag(bsdf->flags(), BSDFFlags::Smooth);
        if (dr::none_or<false>(smooth)) return lit;
        auto [ds, light] = scene->sample_emitter_direction(si, sampler->next_2d(smooth), false, smooth);
        Mask used = smooth && ds.pdf != 0.f;
        if (dr::none_or<false>(used)) return lit;
        const Ray3f toward = si.spawn_ray_to(ds.p);
        const Around here = around.strands_between(scene, toward, hair, seen, used, sampler);
        const Vector3f wo = si.to_local(ds.d);
        auto [value, pdf] = eval_pdf(bsdf, si, wo, here, hair, used);
        value = si.to_world_mueller(value, -wo, si.wi) * around.transmittance(scene, toward, used && !hair, sampler);
        lit.light[used] = value * light * ds.pdf;
        lit.by_emitter = dr::select(used, ds.pdf, 0.f);
        lit.by_bsdf = dr::select(used && !ds.delta, pdf, 0.f);
        return lit;
    }

    Lit as_bsdf_draws(const Scene *scene, Sampler *sampler, SurfaceInteraction3f &si, const BSDFPtr &bsdf, const Mask &hair,
                      const Mask &seen, const Mask &active) const {
        Lit lit;
        if (dr::none_or<false>(active)) return lit;
        const Float u = sampler->next_1d(active);
        const Point2f u2 = sampler->next_2d(active);
        // On hair f is evaluated once the direction, and with it n, is known: only wo and its pdf are used here.
        auto [bs, value] = draw(bsdf, si, u, u2, hair, active);
        Mask used = active && bs.pdf > 0.f && (hair || dr::any(unpolarized_spectrum(value) != 0.f));
        const Ray3f toward = si.spawn_ray(si.to_world(bs.wo));
        // A mirror shows the hair itself.
        const Mask sharp = has_flag(bs.sampled_type, BSDFFlags::Delta);
        const SurfaceInteraction3f si_light = around.beyond_hair(scene, toward, !sharp, used);
        const EmitterPtr emitter = si_light.emitter(scene, used);
        used &= emitter != nullptr;
        if (dr::none_or<false>(used)) return lit;
        const Spectrum light = emitter->eval(si_light, used);
        const DirectionSample3f ds(scene, si_light, si);
        const Float emitter_pdf = dr::select(sharp, 0.f, scene->pdf_emitter_direction(si, ds, used));
        Ray3f up_to = toward;
        up_to.maxt = dr::select(si_light.is_valid(), si_light.t * (1.f - math::ShadowEpsilon<Float>), dr::Largest<Float>);
        value *= bs.pdf * around.transmittance(scene, up_to, used && !hair && !sharp, sampler);
        if (dr::any_or<true>(hair && used)) {
            // Beyond the hair nothing stands in the way: beyond_hair found the light itself.
            const Around here = around.count(scene, up_to, seen, hair && used, sampler);
            value = dr::select(hair, eval_pdf(bsdf, si, bs.wo, here, hair, hair && used).first, value);
            used &= !hair || here.strands >= 0.f;
        }
        lit.light[used] = si.to_world_mueller(value, -bs.wo, si.wi) * light;
        lit.by_emitter = dr::select(used, emitter_pdf, 0.f);
        lit.by_bsdf = dr::select(used, bs.pdf, 0.f);
        return lit;
    }

  private:
    using Around = typename StrandsAround<Float, Spectrum>::Around;

    std::pair<Spectrum, Float> eval_pdf(const BSDFPtr &bsdf, const SurfaceInteraction3f &si, const Vector3f &wo,
                                        const Around &here, const Mask &hair, const Mask &active) const {
        Spectrum value(0.f);
        Float pdf(0.f);
        const Mask on_hair = active && hair, elsewhere = active && !hair;
        if (dr::any_or<true>(on_hair)) {
            SurfaceInteraction3f si_n(si);
            cuticle_mitsuba::set_around(si_n, here);
            const auto context = cuticle_mitsuba::among_strands_context(around.trace ? 0u : cuticle_mitsuba::expected_bit);
            const auto [v, p] = bsdf->eval_pdf(context, si_n, wo, on_hair);
            value = dr::select(on_hair, v * around.other_kinds(bsdf, si, wo, here, on_hair), value);
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
};

NAMESPACE_END(mitsuba)
