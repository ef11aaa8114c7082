// Mitsuba's BSDF `cuticle_bsdf`: the core's closed forms, for a fibre and for Chiang 2016's far field. Its tables come from
// Python (cuticle.mitsuba), which registers `cuticle` on top of it.
#include "hair_bsdf.h"
#include "through_tables.h"

NAMESPACE_BEGIN(mitsuba)

template <typename Float, typename Spectrum> class CuticleBSDF final : public AbsorbingHairBSDF<Float, Spectrum> {
  public:
    MI_IMPORT_BASE(AbsorbingHairBSDF, m_scale, m_sigma_a_set)
    using typename Base::Angles;
    MI_IMPORT_TYPES()
    using FloatBuffer = DynamicBuffer<Float>;
    using Memory = cuticle_mitsuba::Memory<Float>;
    using Model = cuticle::DualScatteringModel<float, Memory>;

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
        const TensorXf &direct = props.get_any<TensorXf>("direct");
        m_rows = int(direct.shape(0));
        m_columns = int(direct.shape(1));
        m_channels = int(direct.shape(3));
        m_direct = direct.array();
        m_through.read(props);
        if (props.has_property("spread")) {
            m_spread = props.get_any<TensorXf>("spread").array();
            const TensorXf &averages = props.get_any<TensorXf>("averages");
            m_average_rows = int(averages.shape(0));
            m_averages = averages.array();
        }

        if (props.has_property("rest")) {
            const TensorXf &rest = props.get_any<TensorXf>("rest");
            m_rest_rows = int(rest.shape(0));
            m_rest = rest.array();
            m_rest_variance = props.get<ScalarFloat>("rest_variance");
        }

        m_exact_channels = props.get<int>("exact_channels");
        m_range = {props.get<ScalarFloat>("sigma_a_low"), props.get<ScalarFloat>("sigma_a_ratio"), m_exact_channels,
                   m_channels - m_exact_channels};
        // The fibre's own absorption has channels of its own; any other falls between two of the range, which is made when
        // it is first needed.
        m_fixed = !props.has_property("scale") && (m_exact_channels == 1 || is_rgb_v<Spectrum>);
        Base::set_flags(m_scale->is_spatially_varying(), m_average_rows > 0 || !m_through.empty()
                                                             ? cuticle_mitsuba::hair_flag | cuticle_mitsuba::mean_flag
                                                             : 0u);
    }

    void parameters_changed(const std::vector<std::string> &keys = {}) override {
        const auto changed = [&](const char *name) { return std::find(keys.begin(), keys.end(), name) != keys.end(); };
        const bool fixed = m_fixed;
        if (keys.empty() || changed("sigma_a") || changed("scale")) m_fixed = false;
        m_again = Base::pigment_again(keys);
        try {
            Base::parameters_changed(keys);
        } catch (...) {  // without tables of other absorptions only its own can be looked up
            m_fixed = fixed;
            m_sigma_a_set |= m_again;
            throw;
        }
    }

    MI_DECLARE_CLASS(CuticleBSDF)

  private:
    bool lacks_tables() const override { return m_again || (!m_fixed && m_range.count == 0); }
    void ask_for_tables(Properties &scene) const override {
        if (!m_fixed) scene.set("scale", 1.0, false);
    }
    void adopt(const HairBSDF<Float, Spectrum> &made) override {
        Base::adopt(made);
        const auto tables = [](auto &b) {
            return std::tie(b.m_fibre, b.m_formulation, b.m_range, b.m_d_f, b.m_d_b, b.m_rest_variance, b.m_rows,
                            b.m_columns, b.m_channels, b.m_exact_channels, b.m_average_rows, b.m_rest_rows, b.m_direct,
                            b.m_spread, b.m_averages, b.m_rest, b.m_through);
        };
        tables(*this) = tables(static_cast<const CuticleBSDF &>(made));
    }

    UnpolarizedSpectrum scattered(const BSDFContext &ctx, const SurfaceInteraction3f &si, const Float &theta_i,
                                  const Angles &r, const Float &phi, Mask active) const override {
        if (cuticle_mitsuba::transmittance(ctx))
            return per_channel(si, active,
                               [&, this](const auto &channel) { return this->transmitted(ctx, si, theta_i, channel); });
        const bool surrounded = cuticle_mitsuba::among_strands(ctx);
        const auto table = [&](const FloatBuffer &data) {
            return cuticle::AzimuthalTable<Memory>{cuticle_mitsuba::memory<Float>(data), m_rows, m_columns, m_channels};
        };
        const Model model{m_fibre,         table(m_direct),
                          table(m_spread), {cuticle_mitsuba::memory<Float>(m_averages), m_average_rows, m_channels},
                          m_formulation,   m_d_f,
                          m_d_b,           m_through.view()};
        const auto at =
            cuticle::locate(model.direct, cuticle::azimuthal_inclination(m_fibre.form, theta_i, r.theta), Float(phi));
        cuticle::AzimuthalTerms<Float> alone;
        cuticle::marschner_terms(m_fibre, theta_i, r.theta, cuticle::mask_all, 1, &alone);
        const auto others = cuticle_mitsuba::around(si);
        const bool random = cuticle_mitsuba::expected(ctx);
        const cuticle::Surroundings<Float> around{random ? others.expected : others.strands, others.behind, random};
        const cuticle::ChiangRest<float, Memory> rest{cuticle_mitsuba::memory<Float>(m_rest), m_rest_rows, m_channels,
                                                      m_rest_variance};
        const auto value = [&](const auto &channel) {
            auto terms = alone;
            if (!surrounded) {
                if (m_rest_rows) terms.constant = cuticle::chiang_far_rest(rest, theta_i, r.theta, channel);
                auto values = cuticle::no_azimuths<Float>();
                cuticle::look_up(model.direct, cuticle::direct_rows, at, channel, values);
                return cuticle::azimuthal_sum(terms, values);
            }
            cuticle::add_surroundings(model, channel, theta_i, r.theta, around, cuticle::mask_all, terms);
            return cuticle::sum_around(model, terms, at, r.theta, Float(phi), channel, around);
        };
        return per_channel(si, active, value) * cuticle::math::cos_theta(theta_i);
    }

    // A spectrum of a value of each channel: the tables' own, or between two of them.
    template <class Value>
    UnpolarizedSpectrum per_channel(const SurfaceInteraction3f &si, const Mask &active, const Value &value) const {
        UnpolarizedSpectrum f(0.f);
        if (m_fixed) {
            for (int j = 0; j < (m_exact_channels == 1 ? 1 : int(dr::size_v<UnpolarizedSpectrum>)); ++j) f[j] = value(j);
            if (m_exact_channels == 1) f = UnpolarizedSpectrum(f[0]);
        } else {
            const UnpolarizedSpectrum sigma_a = Base::absorption(si, active);
            for (size_t j = 0; j < dr::size_v<UnpolarizedSpectrum>; ++j)
                f[j] = value(cuticle::locate<Float>(m_range, sigma_a[j]));
        }
        return f;
    }

    cuticle::FibreLobes<float> m_fibre;
    cuticle::Formulation m_formulation;
    cuticle::AbsorptionRange<float> m_range;
    cuticle_mitsuba::ThroughTables<Float> m_through;
    float m_d_f, m_d_b, m_rest_variance = 0;
    int m_rows, m_columns, m_channels, m_exact_channels, m_average_rows = 0, m_rest_rows = 0;
    bool m_fixed, m_again = false;
    FloatBuffer m_direct, m_spread, m_averages, m_rest;

    MI_TRAVERSE_CB(Base, m_direct, m_spread, m_through.energy, m_through.along, m_through.azimuth, m_through.behind,
                   m_averages, m_rest)
};

CUTICLE_EXPORT_PARTS(CuticleBSDF)

NAMESPACE_END(mitsuba)
