// Mitsuba's BSDF `cuticle_table`: any other scattering function, as the table that exports carry
// (cuticle/scattering/function_table.h): of a strand alone and, where it is known, of one among others. Python
// (cuticle.mitsuba) makes the tables and registers `cuticle`.
#include "hair_bsdf.h"

#include <locale>
#include <sstream>
#include <vector>

NAMESPACE_BEGIN(mitsuba)

template <typename Float, typename Spectrum> class CuticleTable final : public HairBSDF<Float, Spectrum> {
  public:
    MI_IMPORT_BASE(HairBSDF)
    using typename Base::Angles;
    MI_IMPORT_TYPES(Texture)
    static constexpr int most_channels = 3;

    CuticleTable(const Properties &props) : Base(props) {
        m_alone.set(props, "alone_");
        m_among.set(props, "among_");
        if constexpr (is_spectral_v<Spectrum>)
            if (m_alone.channels > 1)
                for (const char *name : {"red", "green", "blue"}) m_primaries.push_back(props.get_texture<Texture>(name));
        Base::set_flags(false, m_among.strands.empty() ? 0u : cuticle_mitsuba::hair_flag);
    }

    MI_DECLARE_CLASS(CuticleTable)

  private:
    struct Table {
        DynamicBuffer<Float> shape, log_energy;
        std::vector<float> strands;
        int viewers = 0, energies = 0, rows = 0, columns = 0, channels = 0;
        float reach = 1, stretch = 1;
        bool even = true;

        // A table that is not there has no strand counts.
        void set(const Properties &props, const std::string &prefix) {
            if (!props.has_property(prefix + "shape")) return;
            const TensorXf &s = props.get_any<TensorXf>(prefix + "shape");
            const TensorXf &e = props.get_any<TensorXf>(prefix + "log_energy");
            std::istringstream counts(props.get<std::string>(prefix + "strands"));
            counts.imbue(std::locale::classic());  // whatever the host has set: 0.5 has a point
            for (float n; counts >> n;) strands.push_back(n);
            if (s.ndim() != 5 || e.ndim() != 3 || s.shape(0) != strands.size() || e.shape(0) != strands.size() ||
                (s.shape(4) != 1 && s.shape(4) != most_channels) || e.shape(2) != s.shape(4))
                Throw(
                    "a table's shape must be (counts, viewers, rows, columns, 1 or 3 channels), its energies' (counts, "
                    "viewers, channels)");
            viewers = int(s.shape(1));
            rows = int(s.shape(2));
            columns = int(s.shape(3));
            channels = int(s.shape(4));
            energies = int(e.shape(1));
            shape = s.array();
            log_energy = e.array();
            reach = props.get<ScalarFloat>(prefix + "reach");
            stretch = props.get<ScalarFloat>(prefix + "stretch");
            even = props.get<bool>(prefix + "even");
        }

        void eval(const Float &theta_i, const Float &theta_r, const Float &phi, const Float &n, Float *f) const {
            using Memory = cuticle_mitsuba::Memory<Float>;
            const cuticle::TabulatedModel<float, Memory> view{cuticle_mitsuba::memory<Float>(shape),
                                                              cuticle_mitsuba::memory<Float>(log_energy),
                                                              int(strands.size()),
                                                              viewers,
                                                              energies,
                                                              rows,
                                                              columns,
                                                              channels,
                                                              reach,
                                                              stretch,
                                                              even};
            cuticle::tabulated_eval(view, strands.data(), theta_i, theta_r, phi, n, f);
        }
    };

    void adopt(const HairBSDF<Float, Spectrum> &made) override {
        Base::adopt(made);
        m_alone = static_cast<const CuticleTable &>(made).m_alone;
        m_among = static_cast<const CuticleTable &>(made).m_among;
    }

    UnpolarizedSpectrum scattered(const BSDFContext &ctx, const SurfaceInteraction3f &si, const Float &theta_i,
                                  const Angles &r, const Float &phi, Mask active) const override {
        Float f[most_channels] = {};
        if (cuticle_mitsuba::transmittance(ctx)) {
            for (int c = 0; c < m_alone.channels; ++c) f[c] = Base::transmitted(ctx, si, theta_i, c);
            return spectrum(si, f, active);
        }
        if (cuticle_mitsuba::among_strands(ctx)) m_among.eval(theta_i, r.theta, phi, cuticle_mitsuba::around(si).strands, f);
        else m_alone.eval(theta_i, r.theta, phi, Float(0), f);
        return spectrum(si, f, active) * cuticle::math::cos_theta(theta_i);
    }

    // Of the channels' values.
    UnpolarizedSpectrum spectrum(const SurfaceInteraction3f &si, const Float *f, const Mask &active) const {
        UnpolarizedSpectrum result(f[0]);
        if (m_alone.channels == 3) {
            if constexpr (is_spectral_v<Spectrum>) {
                result = UnpolarizedSpectrum(0.f);
                for (int c = 0; c < 3; ++c) result += m_primaries[size_t(c)]->eval(si, active) * f[c];
            } else {
                for (int c = 0; c < 3; ++c) result[size_t(c)] = f[c];
            }
        }
        return result;
    }

    Table m_alone, m_among;
    std::vector<ref<Texture>> m_primaries;

    MI_TRAVERSE_CB(Base, m_alone.shape, m_alone.log_energy, m_among.shape, m_among.log_energy, m_primaries)
};

CUTICLE_EXPORT_PLUGIN(CuticleTable)

NAMESPACE_END(mitsuba)
