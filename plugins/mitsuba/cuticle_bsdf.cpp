// Mitsuba's BSDF `cuticle_bsdf`: turns Mitsuba's records into angles and calls the core. Its tables come from Python
// (cuticle.mitsuba), which registers `cuticle` on top of it.
//
// A curve's shading frame has t along the strand and s around it: sin theta = w.y, phi = atan2(w.z, w.x).
// Mitsuba's wi is the viewer's direction (r), wo the light's (i); eval holds the cosine of theta_i.
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

template <typename Float, typename Spectrum> class CuticleBSDF final : public BSDF<Float, Spectrum> {
  public:
    MI_IMPORT_BASE(BSDF, m_flags, m_components)
    MI_IMPORT_TYPES(Texture)
    using FloatBuffer = DynamicBuffer<Float>;
    using Memory = cuticle_mitsuba::Memory<Float>;
    using Model = cuticle::DualScatteringModel<float, Memory>;
    using Channel = cuticle::ChannelBetween<Float>;

    CuticleBSDF(const Properties &props) : Base(props) {
        const auto three = [&](const char *name, float *to) {
            const auto v = props.get<ScalarVector3f>(name);
            for (int p = 0; p < cuticle::lobe_count; ++p) to[p] = v[p];
        };
        three("alpha", m_fibre.alpha);
        three("beta", m_fibre.beta);
        m_formulation = props.get<bool>("exact") ? cuticle::Formulation::exact : cuticle::Formulation::zinke2008;
        m_fibre.form = cuticle::longitudinal_of(m_formulation);
        m_d_f = props.get<ScalarFloat>("d_f");
        m_d_b = props.get<ScalarFloat>("d_b");
        m_limit = props.get<ScalarFloat>("limit");
        const TensorXf &direct = props.get_any<TensorXf>("direct");
        m_rows = int(direct.shape(0));
        m_columns = int(direct.shape(1));
        m_channels = int(direct.shape(3));
        m_direct = direct.array();
        if (props.has_property("averages")) {
            m_spread = props.get_any<TensorXf>("spread").array();
            const TensorXf &averages = props.get_any<TensorXf>("averages");
            m_average_rows = int(averages.shape(0));
            m_averages = averages.array();
        }

        if (props.has_property("single")) m_single.set(props.get_any<TensorXf>("single"), props.get<bool>("single_even"));
        if (props.has_property("combined"))
            m_combined.set(props.get_any<TensorXf>("combined"), props.get<bool>("combined_even"));

        m_exact_channels = props.get<int>("exact_channels");
        m_range = {props.get<ScalarFloat>("sigma_a_low"), props.get<ScalarFloat>("sigma_a_ratio"), m_exact_channels,
                   m_channels - m_exact_channels};
        m_sigma_a = props.get_unbounded_texture<Texture>("sigma_a");
        m_scale = props.get_unbounded_texture<Texture>("scale", 1.f);
        // The fibre's own absorption has channels of its own; any other falls between two of the range.
        m_fixed = !props.has_property("scale") && (m_exact_channels == 1 || is_rgb_v<Spectrum>);
        m_about = props.get<std::string>("about");

        m_components.push_back(BSDFFlags::Glossy | BSDFFlags::Anisotropic | BSDFFlags::NonSymmetric | BSDFFlags::FrontSide |
                               (m_scale->is_spatially_varying() ? BSDFFlags::SpatiallyVarying : BSDFFlags::Empty));
        m_components.push_back(BSDFFlags::Null | BSDFFlags::BackSide);
        m_flags = m_components[0] | m_components[1] | (m_average_rows ? cuticle_mitsuba::hair_flag : 0u);
    }

    void traverse(TraversalCallback *cb) override {
        cb->put("sigma_a", m_sigma_a, ParamFlags::Differentiable);
        cb->put("scale", m_scale, ParamFlags::Differentiable);
    }

    void parameters_changed(const std::vector<std::string> &) override { m_fixed = false; }

    std::pair<BSDFSample3f, Spectrum> sample(const BSDFContext &ctx, const SurfaceInteraction3f &si, Float sample1,
                                             const Point2f &sample2, Mask active) const override {
        MI_MASKED_FUNCTION(ProfilerPhase::BSDFSample, active);
        BSDFSample3f bs = dr::zeros<BSDFSample3f>();
        if (unlikely(dr::none_or<false>(active) || !ctx.is_enabled(BSDFFlags::Glossy))) return {bs, 0.f};
        const Angles r = angles(si.wi);
        const auto &mixture = mixture_of(ctx);
        Float theta_i, phi;
        if (mixture.empty()) {
            const Float sin_theta = Float(2) * sample2.x() - Float(1);
            theta_i = dr::safe_asin(sin_theta);
            phi = dr::TwoPi<Float> * sample2.y();
            bs.pdf = dr::InvFourPi<Float>;
        } else {
            const auto s = mixture.sample(r.theta, sample1, sample2.x(), sample2.y());
            theta_i = s.theta_i;
            phi = s.phi;
            bs.pdf = s.pdf;
        }
        const auto d = cuticle::to_direction(theta_i, Float(r.phi + phi));
        bs.wo = {d.y, d.x, d.z};
        bs.eta = 1.f;
        bs.sampled_type = +BSDFFlags::Glossy;
        bs.sampled_component = 0;
        active &= bs.pdf > 0.f;
        if (cuticle_mitsuba::direction_only(ctx)) return {bs, 0.f};
        const UnpolarizedSpectrum value = scattered(ctx, si, theta_i, r.theta, phi, active);
        return {bs, depolarizer<Spectrum>(dr::select(active, value / bs.pdf, 0.f))};
    }

    Spectrum eval(const BSDFContext &ctx, const SurfaceInteraction3f &si, const Vector3f &wo, Mask active) const override {
        MI_MASKED_FUNCTION(ProfilerPhase::BSDFEvaluate, active);
        if (unlikely(dr::none_or<false>(active) || !ctx.is_enabled(BSDFFlags::Glossy))) return 0.f;
        const Angles r = angles(si.wi), i = angles(wo);
        return depolarizer<Spectrum>(scattered(ctx, si, i.theta, r.theta, i.phi - r.phi, active)) & active;
    }

    Float pdf(const BSDFContext &ctx, const SurfaceInteraction3f &si, const Vector3f &wo, Mask active) const override {
        MI_MASKED_FUNCTION(ProfilerPhase::BSDFEvaluate, active);
        if (unlikely(dr::none_or<false>(active) || !ctx.is_enabled(BSDFFlags::Glossy))) return 0.f;
        const Angles r = angles(si.wi), i = angles(wo);
        return dr::select(active, density(ctx, i.theta, r.theta, i.phi - r.phi), 0.f);
    }

    std::pair<Spectrum, Float> eval_pdf(const BSDFContext &ctx, const SurfaceInteraction3f &si, const Vector3f &wo,
                                        Mask active) const override {
        MI_MASKED_FUNCTION(ProfilerPhase::BSDFEvaluate, active);
        if (unlikely(dr::none_or<false>(active) || !ctx.is_enabled(BSDFFlags::Glossy))) return {0.f, 0.f};
        const Angles r = angles(si.wi), i = angles(wo);
        const Float phi = i.phi - r.phi;
        return {depolarizer<Spectrum>(scattered(ctx, si, i.theta, r.theta, phi, active)) & active,
                dr::select(active, density(ctx, i.theta, r.theta, phi), 0.f)};
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

    MI_DECLARE_CLASS(CuticleBSDF)

  private:
    struct Angles {
        Float theta, phi;
    };
    static Angles angles(const Vector3f &w) {
        const cuticle::Direction<Float> d{w.y(), w.x(), w.z()};
        return {cuticle::theta_of(d), cuticle::phi_of(d)};
    }

    const cuticle_mitsuba::Mixture<Float> &mixture_of(const BSDFContext &ctx) const {
        return cuticle_mitsuba::among_strands(ctx) ? m_combined : m_single;
    }

    Float density(const BSDFContext &ctx, const Float &theta_i, const Float &theta_r, const Float &phi) const {
        const auto &mixture = mixture_of(ctx);
        return mixture.empty() ? dr::InvFourPi<Float> : mixture.pdf(theta_i, theta_r, phi);
    }

    // f cos(theta_i): of the strand alone or, where the context says so, of a strand among others.
    UnpolarizedSpectrum scattered(const BSDFContext &ctx, const SurfaceInteraction3f &si, const Float &theta_i,
                                  const Float &theta_r, const Float &phi, Mask active) const {
        const bool surrounded = cuticle_mitsuba::among_strands(ctx);
        const auto table = [&](const FloatBuffer &data) {
            return cuticle::AzimuthalTable<Memory>{cuticle_mitsuba::memory<Float>(data), m_rows, m_columns, m_channels};
        };
        const Model model{m_fibre,
                          table(m_direct),
                          table(m_spread),
                          {cuticle_mitsuba::memory<Float>(m_averages), m_average_rows, m_limit},
                          m_formulation,
                          m_d_f,
                          m_d_b};
        const auto at =
            cuticle::locate(model.direct, cuticle::azimuthal_inclination(m_fibre.form, theta_i, theta_r), Float(phi));
        cuticle::AzimuthalTerms<Float> alone;
        cuticle::marschner_terms(m_fibre, theta_i, theta_r, cuticle::mask_all, 1, &alone);
        const Float n = surrounded ? cuticle_mitsuba::strands(si) : Float(0);
        const auto value = [&](const auto &channel) {
            if (!surrounded) return cuticle::add_rows(Float(0), model.direct, alone, cuticle::direct_rows, at, channel);
            auto terms = alone;
            cuticle::add_surroundings(model, channel, theta_i, theta_r, n, cuticle::mask_all, terms);
            return cuticle::sum_around(model, terms, at, channel, n);
        };
        UnpolarizedSpectrum f(0.f);
        if (m_fixed) {
            for (int j = 0; j < (m_exact_channels == 1 ? 1 : int(dr::size_v<UnpolarizedSpectrum>)); ++j) f[j] = value(j);
            if (m_exact_channels == 1) f = UnpolarizedSpectrum(f[0]);
        } else {
            const UnpolarizedSpectrum sigma_a = dr::maximum(m_sigma_a->eval(si, active) * m_scale->eval(si, active), 0.f);
            for (size_t j = 0; j < dr::size_v<UnpolarizedSpectrum>; ++j)
                f[j] = value(cuticle::locate<Float>(m_range, sigma_a[j]));
        }
        return f * cuticle::math::cos_theta(theta_i);
    }

    cuticle::FibreLobes<float> m_fibre;
    cuticle::Formulation m_formulation;
    cuticle::AbsorptionRange<float> m_range;
    float m_d_f, m_d_b, m_limit;
    int m_rows, m_columns, m_channels, m_exact_channels, m_average_rows = 0;
    bool m_fixed;
    FloatBuffer m_direct, m_spread, m_averages;
    cuticle_mitsuba::Mixture<Float> m_single, m_combined;
    ref<Texture> m_sigma_a, m_scale;
    std::string m_about;

    MI_TRAVERSE_CB(Base, m_direct, m_spread, m_averages, m_single.m_nodes, m_combined.m_nodes, m_sigma_a, m_scale)
};

CUTICLE_EXPORT_PLUGIN(CuticleBSDF)

NAMESPACE_END(mitsuba)
