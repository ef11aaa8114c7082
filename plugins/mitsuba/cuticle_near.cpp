// Mitsuba's BSDF `cuticle_near`: Chiang 2016 with the offset h at which the ray meets the strand, as Mitsuba's `hair` knows
// it: closed forms, drawn from directly. Python (cuticle.mitsuba) registers `cuticle` on top of it.
#include "fibre_bsdf.h"

NAMESPACE_BEGIN(mitsuba)

template <typename Float, typename Spectrum> class CuticleNear final : public FibreBSDF<Float, Spectrum> {
  public:
    MI_IMPORT_BASE(FibreBSDF)
    MI_IMPORT_TYPES()
    using Base::channels;
    using typename Base::Angles;

    CuticleNear(const Properties &props) : Base(props) { Base::set_flags(Base::varies(), 0u); }

    MI_DECLARE_CLASS(CuticleNear)

  private:
    // The lobes for one viewer, and the absorption of each channel.
    struct Prepared {
        Float sigma_a[channels];
        cuticle::ChiangFibre<Float> fibre;
        cuticle::ChiangState<Float> state;
    };
    Prepared prepare(const SurfaceInteraction3f &si, const Angles &r, Mask active) const {
        const auto value = [&](size_t k) { return Base::parameter(k, si, active); };
        const auto fibre = cuticle::chiang_fibre(value(0), value(1), value(2), value(3));
        const UnpolarizedSpectrum sigma_a = Base::absorption(si, active);
        Prepared out;
        out.fibre.eta = fibre.eta;
        out.fibre.scale = fibre.width;
        for (int p = 0; p < cuticle::chiang_lobes; ++p) {
            out.fibre.variance[p] = fibre.variance[p];
            out.fibre.tilt[p] = fibre.tilt[p];
        }
        for (int c = 0; c < channels; ++c) out.sigma_a[c] = sigma_a[size_t(c)];
        // The viewer's azimuth tells the offset: the strand's normal lies at pi/2 of it.
        out.state = cuticle::chiang_state(out.fibre, Float(r.theta), Float(-dr::cos(r.phi)), out.sigma_a,
                                          Base::luminance().data(), channels);
        return out;
    }

    UnpolarizedSpectrum value(const Prepared &p, const Float &theta_i, const Float &phi) const {
        Float f[channels];
        cuticle::chiang_eval(p.fibre, p.state, p.sigma_a, channels, cuticle::mask_all, theta_i, phi, f);
        UnpolarizedSpectrum result;
        for (int c = 0; c < channels; ++c) result[size_t(c)] = f[c];
        return result * cuticle::math::cos_theta(theta_i);
    }

    std::pair<UnpolarizedSpectrum, Float> value_and_density(const BSDFContext &, const SurfaceInteraction3f &si,
                                                            const Float &theta_i, const Angles &r, const Float &phi,
                                                            Mask active) const override {
        const Prepared p = prepare(si, r, active);
        return {value(p, theta_i, phi), cuticle::chiang_pdf(p.fibre, p.state, theta_i, phi)};
    }
    std::pair<cuticle::Sample<Float>, UnpolarizedSpectrum> draw_with_value(const BSDFContext &,
                                                                           const SurfaceInteraction3f &si, const Angles &r,
                                                                           const Float &sample1, const Point2f &sample2,
                                                                           bool, Mask active) const override {
        const Prepared p = prepare(si, r, active);
        const auto s = cuticle::chiang_sample(p.fibre, p.state, sample1, Float(sample2.x()), Float(sample2.y()));
        return {s, value(p, s.theta_i, s.phi)};
    }
};

CUTICLE_EXPORT_PLUGIN(CuticleNear)

NAMESPACE_END(mitsuba)
