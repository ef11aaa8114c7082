// What hair's BSDFs share: a scattering function that a derived class knows, the lobes it is drawn from, and the numbers of
// the scene's from which Python makes both again when one of them is changed.
//
// A curve's shading frame has t along the strand and s around it: sin theta = w.y, phi = atan2(w.z, w.x).
// Mitsuba's wi is the viewer's direction (r), wo the light's (i); eval holds the cosine of theta_i.
#pragma once

#include "drjit_traits.h"

#include <mitsuba/core/plugin.h>
#include <mitsuba/core/properties.h>
#include <mitsuba/render/bsdf.h>
#include <mitsuba/render/texture.h>

#include <algorithm>
#include <sstream>
#include <tuple>
#include <typeinfo>
#include <utility>

#include "cuticle/cuticle.h"
#include "mixture.h"
#include "strands.h"
#include "variants.h"

NAMESPACE_BEGIN(mitsuba)

template <typename Float, typename Spectrum> class HairBSDF : public BSDF<Float, Spectrum> {
  public:
    MI_IMPORT_BASE(BSDF, m_flags, m_components)
    MI_IMPORT_TYPES()

    std::pair<BSDFSample3f, Spectrum> sample(const BSDFContext &ctx, const SurfaceInteraction3f &si, Float sample1,
                                             const Point2f &sample2, Mask active) const override {
        MI_MASKED_FUNCTION(ProfilerPhase::BSDFSample, active);
        BSDFSample3f bs = dr::zeros<BSDFSample3f>();
        if (unlikely(dr::none_or<false>(active) || !answers(ctx))) return {bs, 0.f};
        const Angles r = angles(si.wi);
        const bool with_value = !cuticle_mitsuba::direction_only(ctx);
        const auto [drawn, scattered] = draw_with_value(ctx, si, r, sample1, sample2, with_value, active);
        const Float &pdf = drawn.pdf;
        const auto d = cuticle::to_direction(drawn.theta_i, Float(r.phi + drawn.phi));
        active &= known(si.wi) && pdf > 0.f;
        bs.wo = dr::select(active, Vector3f(d.y, d.x, d.z), 0.f);
        bs.pdf = dr::select(active, pdf, 0.f);
        bs.eta = 1.f;
        bs.sampled_type = +BSDFFlags::Glossy;
        bs.sampled_component = 0;
        if (!with_value) return {bs, 0.f};
        return {bs, depolarizer<Spectrum>(dr::select(active, scattered / bs.pdf, 0.f))};
    }

    Spectrum eval(const BSDFContext &ctx, const SurfaceInteraction3f &si, const Vector3f &wo, Mask active) const override {
        MI_MASKED_FUNCTION(ProfilerPhase::BSDFEvaluate, active);
        if (unlikely(dr::none_or<false>(active) || !answers(ctx))) return 0.f;
        active &= known(si.wi) && known(wo);
        const Angles r = angles(si.wi), i = angles(wo);
        return depolarizer<Spectrum>(scattered(ctx, si, i.theta, r, i.phi - r.phi, active)) & active;
    }

    Float pdf(const BSDFContext &ctx, const SurfaceInteraction3f &si, const Vector3f &wo, Mask active) const override {
        MI_MASKED_FUNCTION(ProfilerPhase::BSDFEvaluate, active);
        if (unlikely(dr::none_or<false>(active) || !answers(ctx))) return 0.f;
        active &= known(si.wi) && known(wo);
        const Angles r = angles(si.wi), i = angles(wo);
        return dr::select(active, density(ctx, si, i.theta, r, i.phi - r.phi, active), 0.f);
    }

    std::pair<Spectrum, Float> eval_pdf(const BSDFContext &ctx, const SurfaceInteraction3f &si, const Vector3f &wo,
                                        Mask active) const override {
        MI_MASKED_FUNCTION(ProfilerPhase::BSDFEvaluate, active);
        if (unlikely(dr::none_or<false>(active) || !answers(ctx))) return {0.f, 0.f};
        active &= known(si.wi) && known(wo);
        const Angles r = angles(si.wi), i = angles(wo);
        const auto [value, pdf] = value_and_density(ctx, si, i.theta, r, i.phi - r.phi, active);
        return {depolarizer<Spectrum>(value) & active, dr::select(active, pdf, 0.f)};
    }

    void traverse(TraversalCallback *cb) override {
        for (Number &n : m_numbers) cb->put(n.name, n.value, ParamFlags::NonDifferentiable);
    }

    // A number that Python refuses leaves everything as it was.
    void parameters_changed(const std::vector<std::string> & = {}) override {
        Properties scene(m_scene);
        for (const Number &n : m_numbers)
            if (n.value != n.made) scene.set(n.name, double(n.value), false);
        if (scene == m_scene && !lacks_tables()) return;
        ask_for_tables(scene);
        try {
            adopt(static_cast<const HairBSDF &>(*PluginManager::instance()->create_object<Base>(scene)));
        } catch (...) {
            for (Number &n : m_numbers) n.value = n.made;
            throw;
        }
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
        if (props.has_property("transmittance")) {
            const TensorXf &logs = props.get_any<TensorXf>("transmittance");
            m_transmittance_rows = int(logs.shape(2));
            m_transmittance_channels = int(logs.shape(3));
            m_transmittance_limit = props.get<ScalarFloat>("transmittance_limit");
            m_transmittance = logs.array();
        }
        m_about = props.get<std::string>("about");
        if (!props.has_property("scene")) return;
        m_scene = props.get_any<Properties>("scene");
        const auto &numbers = props.get_any<Properties>("numbers");
        for (const auto &key : numbers) {
            const auto value = numbers.get<ScalarFloat>(key.name());
            m_numbers.push_back({std::string(key.name()), value, value});
        }
    }

    // Whether it knows what it does among strands.
    virtual bool among_others() const { return m_flags & cuticle_mitsuba::hair_flag; }

    // Whether tables are needed that were not made, and the parameter by which Python makes them.
    virtual bool lacks_tables() const { return false; }
    virtual void ask_for_tables(Properties &) const {}

    // Takes over everything that follows from the numbers of another BSDF of the same class; textures stay. Numbers keep
    // their place in memory, which whoever traversed them holds.
    virtual void adopt(const HairBSDF &made) {
        std::copy(made.m_numbers.begin(), made.m_numbers.end(), m_numbers.begin());
        const auto rest = [](auto &b) {
            return std::tie(b.m_single, b.m_combined, b.m_about, b.m_scene, b.m_transmittance, b.m_transmittance_rows,
                            b.m_transmittance_channels, b.m_transmittance_limit);
        };
        rest(*this) = rest(made);
        m_flags = made.m_flags | (m_flags & +BSDFFlags::SpatiallyVarying);
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
    // f cos(theta_i): of the strand alone or, where the context says so, of a strand among others; or the transmittance.
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

    // Both together, and what is drawn with its value if it is asked for: overridden where one costs little beside the
    // other.
    virtual std::pair<UnpolarizedSpectrum, Float> value_and_density(const BSDFContext &ctx, const SurfaceInteraction3f &si,
                                                                    const Float &theta_i, const Angles &r, const Float &phi,
                                                                    Mask active) const {
        return {scattered(ctx, si, theta_i, r, phi, active), density(ctx, si, theta_i, r, phi, active)};
    }
    virtual std::pair<cuticle::Sample<Float>, UnpolarizedSpectrum> draw_with_value(const BSDFContext &ctx,
                                                                                   const SurfaceInteraction3f &si,
                                                                                   const Angles &r, const Float &sample1,
                                                                                   const Point2f &sample2, bool with_value,
                                                                                   Mask active) const {
        const cuticle::Sample<Float> s = draw(ctx, si, r, sample1, sample2, active);
        if (!with_value) return {s, 0.f};
        return {s, scattered(ctx, si, s.theta_i, r, s.phi, active)};
    }

    // What hair passes on of light that meets this strand, in a channel.
    template <class Channel>
    Float transmitted(const BSDFContext &ctx, const SurfaceInteraction3f &si, const Float &theta_i,
                      const Channel &channel) const {
        const cuticle::TransmittanceTable<float, cuticle_mitsuba::Memory<Float>> table{
            cuticle_mitsuba::memory<Float>(m_transmittance), m_transmittance_rows, m_transmittance_channels,
            m_transmittance_limit};
        const auto others = cuticle_mitsuba::around(si);
        const bool random = cuticle_mitsuba::expected(ctx);
        return cuticle::transmittance(table, theta_i, random ? others.expected : others.strands, random, channel);
    }

    std::string m_about;
    Properties m_scene;  // by which Python makes this BSDF

  private:
    // Traced code asks every BSDF that is alive, other scenes' too: what does not answer scatters nothing.
    bool answers(const BSDFContext &ctx) const {
        const bool others = cuticle_mitsuba::among_strands(ctx) || cuticle_mitsuba::transmittance(ctx);
        return ctx.is_enabled(BSDFFlags::Glossy) && (!others || among_others());
    }

    // Whether a direction has angles. A curve's segment of no length has no frame: directions there are NaN, and it
    // scatters nothing.
    static Mask known(const Vector3f &w) { return dr::isfinite(dr::squared_norm(w)); }

    static Angles angles(const Vector3f &w) {
        const cuticle::Direction<Float> d{w.y(), w.x(), w.z()};
        return {cuticle::theta_of(d), cuticle::phi_of(d)};
    }

    const cuticle_mitsuba::Mixture<Float> &mixture_of(const BSDFContext &ctx) const {
        return cuticle_mitsuba::among_strands(ctx) ? m_combined : m_single;
    }

    // A parameter of the scene's or its default, and the value that the rest was made for.
    struct Number {
        std::string name;
        ScalarFloat value, made;
    };

    cuticle_mitsuba::Mixture<Float> m_single, m_combined;
    std::vector<Number> m_numbers;
    DynamicBuffer<Float> m_transmittance;
    int m_transmittance_rows = 0, m_transmittance_channels = 0;
    float m_transmittance_limit = 1;

    MI_TRAVERSE_CB(Base, m_single.m_nodes, m_combined.m_nodes, m_transmittance)
};

// Gives a texture the values of another of its kind, in place: whoever traversed it holds it.
template <typename Float> void copy_values(Object &to, Object &from) {
    struct Values : TraversalCallback {
        std::vector<std::pair<void *, const std::type_info *>> found;
        void put_value(std::string_view, void *value, uint32_t, const std::type_info &type) override {
            found.emplace_back(value, &type);
        }
        void put_object(std::string_view, Object *value, uint32_t) override {
            if (value) value->traverse(this);
        }
    } old, made;
    to.traverse(&old);
    from.traverse(&made);
    if (old.found.size() != made.found.size()) Throw("sigma_a: the absorption's texture is of another kind");
    for (size_t k = 0; k < made.found.size(); ++k) {
        const auto copy = [&](auto type) {
            using T = decltype(type);
            if (*old.found[k].second != typeid(T) || *made.found[k].second != typeid(T)) return false;
            *static_cast<T *>(old.found[k].first) = *static_cast<T *>(made.found[k].first);
            return true;
        };
        if (!copy(Float()) && !copy(Color<Float, 3>()) && !copy(DynamicBuffer<Float>()))
            Throw("sigma_a: the absorption's texture is of another kind");
    }
    to.parameters_changed();
}

// One whose absorption is a texture, times another.
template <typename Float, typename Spectrum> class AbsorbingHairBSDF : public HairBSDF<Float, Spectrum> {
  public:
    MI_IMPORT_BASE(HairBSDF, m_about)
    MI_IMPORT_TYPES(Texture)

    void traverse(TraversalCallback *cb) override {
        Base::traverse(cb);
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
        m_absorption = props.get<std::string>("absorption");
    }

    void adopt(const HairBSDF<Float, Spectrum> &other) override {
        Base::adopt(other);
        const auto &made = static_cast<const AbsorbingHairBSDF &>(other);
        if (m_sigma_a_set || m_absorption.empty() || m_absorption == made.m_absorption) return;
        copy_values<Float>(*m_sigma_a, *const_cast<Texture *>(made.m_sigma_a.get()));
        m_absorption = made.m_absorption;
    }

    // A sigma_a that was set stays until a pigment is set, be it to the number that it had: then this is true.
    bool pigment_again(const std::vector<std::string> &keys) {
        const auto any = [&](const char *name) {
            return std::any_of(keys.begin(), keys.end(), [&](auto &key) { return key.rfind(name, 0) == 0; });
        };
        if (any("sigma_a")) m_sigma_a_set = true;
        else if (m_sigma_a_set && (any("eumelanin") || any("pheomelanin"))) {
            m_sigma_a_set = false;
            if (!m_absorption.empty()) m_absorption = "that of sigma_a";
            return true;
        }
        return false;
    }

    UnpolarizedSpectrum absorption(const SurfaceInteraction3f &si, Mask active) const {
        return held(m_sigma_a->eval(si, active) * m_scale->eval(si, active), 0, 1000);
    }

    // What is no number is held to the least.
    template <class Value> static Value held(const Value &x, ScalarFloat low, ScalarFloat high) {
        return dr::select(x >= low, dr::minimum(x, Value(high)), Value(low));
    }

    ref<Texture> m_sigma_a, m_scale;
    std::string m_absorption;  // the fibre's own, in words; none where a texture is the scene's
    bool m_sigma_a_set = false;

    MI_TRAVERSE_CB(Base, m_sigma_a, m_scale)
};

NAMESPACE_END(mitsuba)
