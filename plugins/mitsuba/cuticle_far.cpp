// Mitsuba's BSDF `cuticle_far`: the far field of a fibre, drawn from its own density (far_field.h), every parameter a number
// or a texture. Python (cuticle.mitsuba) registers `cuticle` on top of it.
//
// Among strands the others are those of a mean fibre, whose tables Python makes when dual_scattering first asks for them.
// The strand itself keeps its own energies, tilts and widths.
#include "fibre_bsdf.h"
#include "through_tables.h"

#include "cuticle/scattering/far_among.h"
#include "cuticle/scattering/through_draw.h"

NAMESPACE_BEGIN(mitsuba)

template <typename Float, typename Spectrum> class CuticleFar final : public FibreBSDF<Float, Spectrum> {
  public:
    MI_IMPORT_BASE(FibreBSDF, m_flags)
    MI_IMPORT_TYPES(Texture)
    using Base::channels;
    using typename Base::Angles;
    using FloatBuffer = DynamicBuffer<Float>;
    using Memory = cuticle_mitsuba::Memory<Float>;

    CuticleFar(const Properties &props) : Base(props) {
        m_form = props.get<bool>("logistic") ? cuticle::Azimuthal::logistic : cuticle::Azimuthal::normal;
        m_share = props.get<ScalarFloat>("direct_share");
        read_tables(props);
        Base::set_flags(Base::varies(), others);
    }

    void parameters_changed(const std::vector<std::string> &keys = {}) override {
        const bool asked = keys.size() == 1 && keys[0] == cuticle_mitsuba::strand_tables;
        if (!asked) {
            Base::parameters_changed(keys);
            m_tables = Tables();  // they were made for other values
            m_flags |= others;
        } else if (!among_others()) {
            const Properties scene = Base::scene_of_tables();
            adopt(static_cast<const CuticleFar &>(*PluginManager::instance()->create_object<BSDF<Float, Spectrum>>(scene)));
            if (!among_others()) m_flags &= ~others;  // without absorption, light among strands has no sum
        }
    }

    MI_DECLARE_CLASS(CuticleFar)

  private:
    static constexpr uint32_t others = cuticle_mitsuba::hair_flag | cuticle_mitsuba::mean_flag;

    // What the others do, of a mean fibre: a channel of its own for each absorption.
    struct Tables {
        cuticle_mitsuba::ThroughTables<Float> through;
        float d_f = 1, d_b = 1;
        float tilt[cuticle::lobe_count], variance[cuticle::lobe_count];
        float sigma_a[3];
        FloatBuffer draw_lobes, draw_azimuth;
    };

    void read_tables(const Properties &props) {
        Tables &t = m_tables;
        t.through.read(props);
        if (t.through.empty()) return;
        t.d_f = props.get<ScalarFloat>("number_d_f");
        t.d_b = props.get<ScalarFloat>("number_d_b");
        const auto tilt = props.get<ScalarVector3f>("mean_tilt"), variance = props.get<ScalarVector3f>("mean_variance"),
                   sigma_a = props.get<ScalarVector3f>("mean_sigma_a");
        for (int p = 0; p < cuticle::lobe_count; ++p) {
            t.tilt[p] = tilt[p];
            t.variance[p] = variance[p];
            t.sigma_a[p] = sigma_a[p];
        }
        t.draw_lobes = props.get_any<TensorXf>("draw_lobes").array();
        t.draw_azimuth = props.get_any<TensorXf>("draw_azimuth").array();
        m_mean = props.get_unbounded_texture<Texture>("mean_absorption");
    }

    void adopt(const HairBSDF<Float, Spectrum> &other) override {
        Base::adopt(other);
        const auto &made = static_cast<const CuticleFar &>(other);
        m_tables = made.m_tables;
        m_mean = made.m_mean;
    }

    struct Prepared {
        cuticle::FarFibre<Float> fibre;
        cuticle::FarField<Float, channels> field;
    };
    Prepared prepare(const SurfaceInteraction3f &si, const Angles &r, const Mask &active) const {
        const auto value = [&](size_t k) { return Base::parameter(k, si, active); };
        Prepared out;
        if (m_form == cuticle::Azimuthal::logistic)
            out.fibre = cuticle::chiang_fibre(value(0), value(1), value(2), value(3));
        else
            out.fibre =
                cuticle::marschner_fibre(value(0), value(1), value(2), value(3), value(4), value(5), value(6), value(7));
        const UnpolarizedSpectrum sigma_a = Base::absorption(si, active);
        Float absorption[channels];
        for (int c = 0; c < channels; ++c) absorption[c] = sigma_a[size_t(c)];
        out.field = cuticle::far_field<channels>(m_form, out.fibre, r.theta, absorption, Base::luminance().data());
        return out;
    }

    cuticle::MeanStrands<float, Memory> mean_strands() const {
        const Tables &t = m_tables;
        cuticle::MeanStrands<float, Memory> mean{t.through.view(), {}, {}, t.d_f, t.d_b};
        std::copy_n(t.tilt, cuticle::lobe_count, mean.tilt);
        std::copy_n(t.variance, cuticle::lobe_count, mean.variance);
        return mean;
    }
    cuticle::ThroughDraw<float, Memory> draw_table() const {
        const Tables &t = m_tables;
        return {cuticle_mitsuba::memory<Float>(t.draw_lobes),
                cuticle_mitsuba::memory<Float>(t.draw_azimuth),
                t.through.along_rows,
                t.through.azimuth_rows,
                t.through.columns,
                t.through.limit};
    }
    cuticle::ThroughMixture<Float> through_mixture(const Prepared &p, const Angles &r) const {
        const auto weights = Base::luminance();
        Float energy[cuticle::far_lobes];
        for (int part = 0; part < cuticle::far_lobes; ++part) {
            energy[part] = Float(0);
            for (int c = 0; c < channels; ++c) energy[part] += weights[size_t(c)] * p.field.energy[c][part];
        }
        return cuticle::through_mixture(draw_table(), r.theta, cuticle::own_parts(mean_strands(), p.fibre, energy));
    }

    // use(channel) with the tables' channel, or between two of them, for each value of a spectrum.
    template <class Use>
    UnpolarizedSpectrum per_channel(const SurfaceInteraction3f &si, const Mask &active, const Use &use) const {
        UnpolarizedSpectrum out(0.f);
        const int known = m_tables.through.channels;
        if (known == 1 || is_rgb_v<Spectrum>) {
            for (int c = 0; c < channels; ++c) out[size_t(c)] = use(c, std::min(c, known - 1));
            return out;
        }
        const UnpolarizedSpectrum mean = m_mean->eval(si, active);
        for (int c = 0; c < channels; ++c) {
            const float *s = m_tables.sigma_a;
            const Mask upper = mean[size_t(c)] >= s[1] && known == 3;
            const Float low = dr::select(upper, s[1], s[0]), high = dr::select(upper, s[2], s[1]);
            out[size_t(c)] = use(c, cuticle::ChannelBetween<Float>{
                                        cuticle::ArrayTraits<Float>::to_index(dr::select(upper, Float(1), Float(0))),
                                        (mean[size_t(c)] - low) / (high - low)});
        }
        return out;
    }

    UnpolarizedSpectrum among(const BSDFContext &ctx, const SurfaceInteraction3f &si, const Prepared &p,
                              const Float &theta_i, const Angles &r, const Float &phi, const UnpolarizedSpectrum &alone,
                              const Mask &active) const {
        const auto met = cuticle_mitsuba::around(si);
        const bool random = cuticle_mitsuba::expected(ctx);
        const cuticle::Surroundings<Float> around{random ? met.expected : met.strands, met.behind, random};
        const auto mean = mean_strands();
        const auto place = cuticle::place_among(mean.through, Float(r.theta), around);
        return per_channel(si, active, [&](int c, const auto &channel) {
            const auto own = cuticle::own_parts(mean, p.fibre, p.field.energy[c]);
            const auto parts = cuticle::among_parts(mean, place, around, own, channel);
            return cuticle::among_value(mean, place, parts, theta_i, Float(phi), channel, Float(alone[size_t(c)]));
        });
    }

    std::pair<UnpolarizedSpectrum, Float> value_and_density(const BSDFContext &ctx, const SurfaceInteraction3f &si,
                                                            const Float &theta_i, const Angles &r, const Float &phi,
                                                            Mask active) const override {
        if (cuticle_mitsuba::transmittance(ctx))
            return {
                per_channel(si, active,
                            [&, this](int, const auto &channel) { return this->transmitted(ctx, si, theta_i, channel); }),
                Float(0)};
        const Prepared p = prepare(si, r, active);
        Float f[channels];
        const Float own = cuticle::far_eval(m_form, p.field, theta_i, phi, f);
        const UnpolarizedSpectrum alone = colour(f);
        const Float cosine = cuticle::math::cos_theta(theta_i);
        if (!cuticle_mitsuba::among_strands(ctx)) return {alone * cosine, own};
        const Float through = cuticle::through_pdf(draw_table(), through_mixture(p, r), theta_i, phi);
        return {among(ctx, si, p, theta_i, r, phi, alone, active) * cosine, m_share * own + (1 - m_share) * through};
    }

    std::pair<cuticle::Sample<Float>, UnpolarizedSpectrum> draw_with_value(const BSDFContext &ctx,
                                                                           const SurfaceInteraction3f &si, const Angles &r,
                                                                           const Float &sample1, const Point2f &sample2,
                                                                           bool with_value, Mask active) const override {
        const Prepared p = prepare(si, r, active);
        Float f[channels];
        const bool surrounded = cuticle_mitsuba::among_strands(ctx);
        if (!surrounded) {
            const auto s = cuticle::far_sample(m_form, p.field, sample1, Float(sample2.x()), Float(sample2.y()), f);
            return {s, colour(f) * cuticle::math::cos_theta(s.theta_i)};
        }
        const Mask direct = sample1 < m_share;
        const Float left = dr::minimum(dr::select(direct, sample1 / m_share, (sample1 - m_share) / (1 - m_share)),
                                       dr::OneMinusEpsilon<Float>);
        const auto mixture = through_mixture(p, r);
        cuticle::Sample<Float> s = dr::zeros<cuticle::Sample<Float>>();
        UnpolarizedSpectrum alone(0.f);
        // One of the two is asked where it is known which; traced code computes both.
        if (dr::any_or<true>(direct)) {
            s = cuticle::far_sample(m_form, p.field, left, Float(sample2.x()), Float(sample2.y()), f);
            s.pdf = m_share * s.pdf + (1 - m_share) * cuticle::through_pdf(draw_table(), mixture, s.theta_i, s.phi);
            alone = colour(f);
        }
        if (dr::any_or<true>(!direct)) {
            auto other = cuticle::through_sample(draw_table(), mixture, left, Float(sample2.x()), Float(sample2.y()));
            other.pdf =
                (1 - m_share) * other.pdf + m_share * cuticle::far_eval(m_form, p.field, other.theta_i, other.phi, f);
            s.theta_i = dr::select(direct, s.theta_i, other.theta_i);
            s.phi = dr::select(direct, s.phi, other.phi);
            s.pdf = dr::select(direct, s.pdf, other.pdf);
            alone = dr::select(direct, alone, colour(f));
        }
        if (!with_value) return {s, 0.f};
        return {s, among(ctx, si, p, s.theta_i, r, s.phi, alone, active) * cuticle::math::cos_theta(s.theta_i)};
    }

    bool among_others() const override { return !m_tables.through.empty(); }

    static UnpolarizedSpectrum colour(const Float *f) {
        UnpolarizedSpectrum value;
        for (int c = 0; c < channels; ++c) value[size_t(c)] = f[c];
        return value;
    }

    cuticle::Azimuthal m_form;
    float m_share;  // of directions among strands that are drawn as for one alone
    Tables m_tables;
    ref<Texture> m_mean;

    MI_TRAVERSE_CB(Base, m_tables.through.energy, m_tables.through.along, m_tables.through.azimuth, m_tables.through.behind,
                   m_tables.draw_lobes, m_tables.draw_azimuth, m_mean)
};

CUTICLE_EXPORT_PARTS(CuticleFar)

NAMESPACE_END(mitsuba)
