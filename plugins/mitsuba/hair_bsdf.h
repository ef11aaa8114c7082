// What hair's BSDFs share: a scattering function that a derived class knows, and the lobes it is drawn from.
//
// A curve's shading frame has t along the strand and s around it: sin theta = w.y, phi = atan2(w.z, w.x).
// Mitsuba's wi is the viewer's direction (r), wo the light's (i); eval holds the cosine of theta_i.
#pragma once

#include "drjit_traits.h"

#include <mitsuba/core/properties.h>
#include <mitsuba/render/bsdf.h>
#include <mitsuba/render/texture.h>

#include <sstream>

#include "cuticle/cuticle.h"
#include "mixture.h"
#include "strands.h"
#include "variants.h"

NAMESPACE_BEGIN(mitsuba)

template <typename Float, typename Spectrum> class HairBSDF : public BSDF<Float, Spectrum> {
  public:
    MI_IMPORT_BASE(BSDF, m_flags, m_components)
    MI_IMPORT_TYPES(Texture)

    std::pair<BSDFSample3f, Spectrum> sample(const BSDFContext &ctx, const SurfaceInteraction3f &si, Float sample1,
                                             const Point2f &sample2, Mask active) const override {
        MI_MASKED_FUNCTION(ProfilerPhase::BSDFSample, active);
        BSDFSample3f bs = dr::zeros<BSDFSample3f>();
        if (unlikely(dr::none_or<false>(active) || !ctx.is_enabled(BSDFFlags::Glossy))) return {bs, 0.f};
        const Angles r = angles(si.wi);
        const auto [theta_i, phi, pdf] = draw(ctx, si, r, sample1, sample2, active);
        const auto d = cuticle::to_direction(theta_i, Float(r.phi + phi));
        bs.wo = {d.y, d.x, d.z};
        bs.pdf = pdf;
        bs.eta = 1.f;
        bs.sampled_type = +BSDFFlags::Glossy;
        bs.sampled_component = 0;
        active &= bs.pdf > 0.f;
        if (cuticle_mitsuba::direction_only(ctx)) return {bs, 0.f};
        const UnpolarizedSpectrum value = scattered(ctx, si, theta_i, r, phi, active);
        return {bs, depolarizer<Spectrum>(dr::select(active, value / bs.pdf, 0.f))};
    }

    Spectrum eval(const BSDFContext &ctx, const SurfaceInteraction3f &si, const Vector3f &wo, Mask active) const override {
        MI_MASKED_FUNCTION(ProfilerPhase::BSDFEvaluate, active);
        if (unlikely(dr::none_or<false>(active) || !ctx.is_enabled(BSDFFlags::Glossy))) return 0.f;
        const Angles r = angles(si.wi), i = angles(wo);
        return depolarizer<Spectrum>(scattered(ctx, si, i.theta, r, i.phi - r.phi, active)) & active;
    }

    Float pdf(const BSDFContext &ctx, const SurfaceInteraction3f &si, const Vector3f &wo, Mask active) const override {
        MI_MASKED_FUNCTION(ProfilerPhase::BSDFEvaluate, active);
        if (unlikely(dr::none_or<false>(active) || !ctx.is_enabled(BSDFFlags::Glossy))) return 0.f;
        const Angles r = angles(si.wi), i = angles(wo);
        return dr::select(active, density(ctx, si, i.theta, r, i.phi - r.phi, active), 0.f);
    }

    std::pair<Spectrum, Float> eval_pdf(const BSDFContext &ctx, const SurfaceInteraction3f &si, const Vector3f &wo,
                                        Mask active) const override {
        MI_MASKED_FUNCTION(ProfilerPhase::BSDFEvaluate, active);
        if (unlikely(dr::none_or<false>(active) || !ctx.is_enabled(BSDFFlags::Glossy))) return {0.f, 0.f};
        const Angles r = angles(si.wi), i = angles(wo);
        const Float phi = i.phi - r.phi;
        return {depolarizer<Spectrum>(scattered(ctx, si, i.theta, r, phi, active)) & active,
                dr::select(active, density(ctx, si, i.theta, r, phi, active), 0.f)};
    }

    std::string to_string() const override {
        std::ostringstream out;
        out << "Cuticle[" << std::endl << "  " << string::indent(m_about) << std::endl << "]";
        return out.str();
    }

  protected:
    HairBSDF(const Properties &props) : Base(props) {
        if (props.has_property("single")) m_single.set(props.get_any<TensorXf>("single"), props.get<bool>("single_even"));
        if (props.has_property("combined"))
            m_combined.set(props.get_any<TensorXf>("combined"), props.get<bool>("combined_even"));
        m_about = props.get<std::string>("about");
    }

    // `others`: what it knows of other strands, flags of strands.h.
    void set_flags(bool spatially_varying, uint32_t others) {
        m_components.push_back(BSDFFlags::Glossy | BSDFFlags::Anisotropic | BSDFFlags::NonSymmetric | BSDFFlags::FrontSide |
                               (spatially_varying ? BSDFFlags::SpatiallyVarying : BSDFFlags::Empty));
        m_components.push_back(BSDFFlags::Null | BSDFFlags::BackSide);
        m_flags = m_components[0] | m_components[1] | others;
    }

    struct Angles {
        Float theta, phi;
    };

    // For a viewer at r; phi is measured from its azimuth.
    // f cos(theta_i): of the strand alone or, where the context says so, of a strand among others.
    virtual UnpolarizedSpectrum scattered(const BSDFContext &ctx, const SurfaceInteraction3f &si, const Float &theta_i,
                                          const Angles &r, const Float &phi, Mask active) const = 0;

    // theta_i, phi and their density in 1/sr: from the lobes, or where there are none over the sphere.
    virtual cuticle::Sample<Float> draw(const BSDFContext &ctx, const SurfaceInteraction3f &, const Angles &r,
                                        const Float &sample1, const Point2f &sample2, Mask) const {
        const auto &mixture = mixture_of(ctx);
        if (!mixture.empty()) return mixture.sample(r.theta, sample1, sample2.x(), sample2.y());
        return {dr::safe_asin(Float(2) * sample2.x() - Float(1)), dr::TwoPi<Float> * sample2.y(), dr::InvFourPi<Float>};
    }

    // The density of `draw`.
    virtual Float density(const BSDFContext &ctx, const SurfaceInteraction3f &, const Float &theta_i, const Angles &r,
                          const Float &phi, Mask) const {
        const auto &mixture = mixture_of(ctx);
        return mixture.empty() ? dr::InvFourPi<Float> : mixture.pdf(theta_i, r.theta, phi);
    }

    std::string m_about;

  private:
    static Angles angles(const Vector3f &w) {
        const cuticle::Direction<Float> d{w.y(), w.x(), w.z()};
        return {cuticle::theta_of(d), cuticle::phi_of(d)};
    }

    const cuticle_mitsuba::Mixture<Float> &mixture_of(const BSDFContext &ctx) const {
        return cuticle_mitsuba::among_strands(ctx) ? m_combined : m_single;
    }

    cuticle_mitsuba::Mixture<Float> m_single, m_combined;

    MI_TRAVERSE_CB(Base, m_single.m_nodes, m_combined.m_nodes)
};

// One whose absorption is a texture, times another.
template <typename Float, typename Spectrum> class AbsorbingHairBSDF : public HairBSDF<Float, Spectrum> {
  public:
    MI_IMPORT_BASE(HairBSDF, m_about)
    MI_IMPORT_TYPES(Texture)

    void traverse(TraversalCallback *cb) override {
        cb->put("sigma_a", m_sigma_a, ParamFlags::Differentiable);
        cb->put("scale", m_scale, ParamFlags::Differentiable);
    }

    std::string to_string() const override {
        std::ostringstream out;
        out << "Cuticle[" << std::endl
            << "  " << string::indent(m_about) << "," << std::endl
            << "  sigma_a = " << string::indent(m_sigma_a) << "," << std::endl
            << "  scale = " << string::indent(m_scale) << std::endl
            << "]";
        return out.str();
    }

  protected:
    AbsorbingHairBSDF(const Properties &props) : Base(props) {
        m_sigma_a = props.get_unbounded_texture<Texture>("sigma_a");
        m_scale = props.get_unbounded_texture<Texture>("scale", 1.f);
    }

    UnpolarizedSpectrum absorption(const SurfaceInteraction3f &si, Mask active) const {
        return dr::maximum(m_sigma_a->eval(si, active) * m_scale->eval(si, active), 0.f);
    }

    ref<Texture> m_sigma_a, m_scale;

    MI_TRAVERSE_CB(Base, m_sigma_a, m_scale)
};

NAMESPACE_END(mitsuba)
