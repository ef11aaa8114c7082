// Mitsuba's BSDF `cuticle_near`: Chiang 2016 with the offset h at which the ray meets the strand, as Mitsuba's `hair` knows
// it: closed forms, drawn from directly. Python (cuticle.mitsuba) registers `cuticle` on top of it.
#include "hair_bsdf.h"

NAMESPACE_BEGIN(mitsuba)

template <typename Float, typename Spectrum> class CuticleNear final : public AbsorbingHairBSDF<Float, Spectrum> {
  public:
    MI_IMPORT_BASE(AbsorbingHairBSDF, m_scale)
    MI_IMPORT_TYPES(Texture)
    using typename Base::Angles;
    static constexpr int channels = int(dr::size_v<UnpolarizedSpectrum>);

    CuticleNear(const Properties &props) : Base(props) {
        m_fibre.eta = props.get<ScalarFloat>("eta");
        m_fibre.scale = props.get<ScalarFloat>("logistic_scale");
        for (int p = 0; p < cuticle::chiang_lobes; ++p) {
            m_fibre.variance[p] = props.get<ScalarFloat>("variance_" + std::to_string(p));
            m_fibre.tilt[p] = props.get<ScalarFloat>("tilt_" + std::to_string(p));
        }
        Base::set_flags(m_scale->is_spatially_varying(), false);
    }

    MI_DECLARE_CLASS(CuticleNear)

  private:
    void adopt(const HairBSDF<Float, Spectrum> &made) override {
        Base::adopt(made);
        m_fibre = static_cast<const CuticleNear &>(made).m_fibre;
    }

    // The lobes for one viewer, and the absorption of each channel.
    struct Prepared {
        Float sigma_a[channels];
        cuticle::ChiangState<Float> state;
    };
    Prepared prepare(const SurfaceInteraction3f &si, const Angles &r, Mask active) const {
        const UnpolarizedSpectrum sigma_a = Base::absorption(si, active);
        float luminance[channels];
        for (int c = 0; c < channels; ++c) luminance[c] = is_rgb_v<Spectrum> ? rec709[c % 3] : 1.f / channels;
        Prepared out;
        for (int c = 0; c < channels; ++c) out.sigma_a[c] = sigma_a[size_t(c)];
        // The viewer's azimuth tells the offset: the strand's normal lies at pi/2 of it.
        out.state = cuticle::chiang_state(m_fibre, Float(r.theta), Float(-dr::cos(r.phi)), out.sigma_a, luminance, channels);
        return out;
    }

    UnpolarizedSpectrum scattered(const BSDFContext &, const SurfaceInteraction3f &si, const Float &theta_i, const Angles &r,
                                  const Float &phi, Mask active) const override {
        const Prepared p = prepare(si, r, active);
        Float f[channels];
        cuticle::chiang_eval(m_fibre, p.state, p.sigma_a, channels, cuticle::mask_all, theta_i, phi, f);
        UnpolarizedSpectrum result;
        for (int c = 0; c < channels; ++c) result[size_t(c)] = f[c];
        return result * cuticle::math::cos_theta(theta_i);
    }
    cuticle::Sample<Float> draw(const BSDFContext &, const SurfaceInteraction3f &si, const Angles &r, const Float &sample1,
                                const Point2f &sample2, Mask active) const override {
        return cuticle::chiang_sample(m_fibre, prepare(si, r, active).state, sample1, Float(sample2.x()),
                                      Float(sample2.y()));
    }
    Float density(const BSDFContext &, const SurfaceInteraction3f &si, const Float &theta_i, const Angles &r,
                  const Float &phi, Mask active) const override {
        return cuticle::chiang_pdf(m_fibre, prepare(si, r, active).state, theta_i, phi);
    }

    static constexpr float rec709[] = {.2126f, .7152f, .0722f};
    cuticle::ChiangFibre<float> m_fibre;
};

CUTICLE_EXPORT_PLUGIN(CuticleNear)

NAMESPACE_END(mitsuba)
