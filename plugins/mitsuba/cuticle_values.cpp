// Mitsuba's texture `cuticle_values`: values at the two ends of each segment of a curve, linear between. Python
// (cuticle.mitsuba) registers `cuticle_strands` on top of it, which reads them from a groom.
//
// A bitmap over v, which runs through all segments of a file, would do for few strands: v has 24 bits for all of them.
#include "drjit_traits.h"

#include <drjit/tensor.h>
#include <mitsuba/core/properties.h>
#include <mitsuba/render/interaction.h>
#include <mitsuba/render/texture.h>

#include <sstream>

#include "variants.h"

NAMESPACE_BEGIN(mitsuba)

template <typename Float, typename Spectrum> class CuticleValues final : public Texture<Float, Spectrum> {
  public:
    MI_IMPORT_TYPES(Texture)
    using Base = Texture;

    CuticleValues(const Properties &props) : Base(props) {
        m_values = props.get_any<TensorXf>("values");
        check();
        m_accepted = m_values;
    }

    void traverse(TraversalCallback *cb) override { cb->put("values", m_values, ParamFlags::Differentiable); }
    void parameters_changed(const std::vector<std::string> & = {}) override {
        try {
            check();
        } catch (...) {  // what is refused leaves the values as they were
            m_values = m_accepted;
            throw;
        }
        m_accepted = m_values;
    }

    UnpolarizedSpectrum eval(const SurfaceInteraction3f &si, Mask active) const override {
        if (channels() == 1) return eval_1(si, active);
        if constexpr (is_rgb_v<Spectrum>) {
            return eval_3(si, active);
        } else {
            (void)si;
            (void)active;
            Throw(
                "cuticle_strands: values of three channels are RGB, and this variant is spectral: give pigments, or a "
                "scale");
        }
    }
    Float eval_1(const SurfaceInteraction3f &si, Mask active) const override {
        if (channels() != 1) Throw("cuticle_strands: one channel is asked for, the values have %d", channels());
        return value(si, 0, active);
    }
    Color3f eval_3(const SurfaceInteraction3f &si, Mask active) const override {
        if (channels() == 1) return Color3f(value(si, 0, active));
        return {value(si, 0, active), value(si, 1, active), value(si, 2, active)};
    }

    Float mean() const override { return dr::mean(m_values.array()); }
    ScalarFloat max() const override { return scalar(dr::max(m_values.array())); }
    bool is_spatially_varying() const override { return true; }

    std::string to_string() const override {
        std::ostringstream out;
        out << "CuticleStrands[" << segments() << " segments, " << channels() << " channels]";
        return out.str();
    }

    MI_DECLARE_CLASS(CuticleValues)

  private:
    uint32_t segments() const { return uint32_t(m_values.shape(0)); }
    uint32_t channels() const { return uint32_t(m_values.shape(2)); }

    void check() const {
        if (m_values.ndim() != 3 || m_values.shape(0) == 0 || m_values.shape(1) != 2 ||
            (m_values.shape(2) != 1 && m_values.shape(2) != 3))
            Throw("cuticle_strands: values must have shape (segments, 2, 1 or 3)");
    }

    // A hit on another shape, of more segments, takes the last.
    Float value(const SurfaceInteraction3f &si, uint32_t channel, const Mask &active) const {
        const UInt32 segment = dr::minimum(si.prim_index, segments() - 1), at = segment * (2 * channels()) + channel;
        const Float along = dr::clip(si.uv.y() * ScalarFloat(segments()) - Float(segment), 0.f, 1.f);
        return dr::lerp(dr::gather<Float>(m_values.array(), at, active),
                        dr::gather<Float>(m_values.array(), at + channels(), active), along);
    }

    static ScalarFloat scalar(const Float &x) {
        if constexpr (dr::is_jit_v<Float>) return dr::slice(x, 0);
        else return x;
    }

    TensorXf m_values, m_accepted;  // [segment][its two ends][channel]; and those that were right last

    MI_TRAVERSE_CB(Base, m_values)
};

CUTICLE_EXPORT_PLUGIN(CuticleValues)

NAMESPACE_END(mitsuba)
