// Hair's BSDFs in closed form: every parameter of the fibre is a number, which may be changed and differentiated, or a
// texture. Nothing is tabulated for a strand on its own.
#pragma once

#include "hair_bsdf.h"

NAMESPACE_BEGIN(mitsuba)

template <typename Float, typename Spectrum> class FibreBSDF : public AbsorbingHairBSDF<Float, Spectrum> {
  public:
    MI_IMPORT_BASE(AbsorbingHairBSDF, held, m_scale, m_sigma_a, m_sigma_a_set, m_scene)
    MI_IMPORT_TYPES(Texture)
    using typename Base::Angles;
    static constexpr int channels = int(dr::size_v<UnpolarizedSpectrum>);

    void traverse(TraversalCallback *cb) override {
        for (size_t k = 0; k < m_slots.size(); ++k) {
            if (m_textures[k]) cb->put(m_slots[k].name, m_textures[k], ParamFlags::Differentiable);
            else cb->put(m_slots[k].name, m_values[k], ParamFlags::Differentiable);
        }
        if (m_made_by == Absorption::color) cb->put("color", m_color, ParamFlags::Differentiable);
        if (m_made_by == Absorption::sigma_a) cb->put("sigma_a", m_sigma_a, ParamFlags::Differentiable);
        cb->put("scale", m_scale, ParamFlags::Differentiable);
    }

    // Python makes what follows from the numbers, such as a pigment's absorption, and refuses those out of range: then all
    // stays as it was.
    void parameters_changed(const std::vector<std::string> &keys = {}) override {
        Properties scene(m_scene);
        const bool again = this->pigment_again(keys);
        try {
            if (set_numbers(scene) || again)
                this->adopt(static_cast<const FibreBSDF &>(
                    *PluginManager::instance()->create_object<mitsuba::BSDF<Float, Spectrum>>(scene)));
        } catch (...) {
            for (size_t k = 0; k < m_slots.size(); ++k) m_values[k] = m_slots[k].made;
            m_sigma_a_set |= again;
            throw;
        }
        // What Python made of a number has no gradient: where one is asked for, the number itself is used.
        const bool sigma_a = std::any_of(keys.begin(), keys.end(), [](auto &key) { return key.rfind("sigma_a", 0) == 0; });
        m_attached = false;
        const size_t first = m_color ? roughness : m_parameters, count = m_color ? 1 : m_pigments;
        for (size_t k = first; k < first + count; ++k) m_attached |= !sigma_a && has_gradient(m_values[k]);
        for (size_t k = 0; k < m_slots.size(); ++k)
            if (has_gradient(m_values[k])) m_slots[k].follows = -1;
        make_opaque();
    }

  protected:
    FibreBSDF(const Properties &props) : Base(props) {
        const auto names = string::tokenize(props.get<std::string>("parameters"));
        m_parameters = size_t(props.get<int>("shape_parameters"));
        bool varies = m_scale->is_spatially_varying() || m_sigma_a->is_spatially_varying();
        for (const std::string &name : names) {
            Slot slot{name, 0, 0, 1, 0, 0, -1};
            ref<Texture> texture;
            const auto range = props.get<ScalarVector3f>("range_" + name);
            slot.low = range.x();
            slot.high = range.y();
            slot.unit = range.z();
            if (props.has_property("texture_" + name)) {
                texture = props.get_unbounded_texture<Texture>("texture_" + name);
                varies |= texture->is_spatially_varying();
            }
            slot.made = props.get<ScalarFloat>("number_" + name);
            if (props.has_property("follows_" + name)) {
                slot.factor = props.get<ScalarFloat>("follows_" + name);
                const auto base = std::find(names.begin(), names.end(), name.substr(0, name.find('_')) + "_R");
                slot.follows = int(base - names.begin());
            }
            m_slots.push_back(slot);
            m_textures.push_back(texture);
            m_values.push_back(slot.made);
        }
        for (auto [name, to] : {std::pair{"color", &m_color},
                                {"eumelanin_absorption", &m_absorption_of[0]},
                                {"pheomelanin_absorption", &m_absorption_of[1]}})
            if (props.has_property(name)) *to = props.get_unbounded_texture<Texture>(name);
        if (m_color) varies |= m_color->is_spatially_varying();
        m_varies = varies;
        m_pigments = m_absorption_of[0] ? 2 : 0;
        make_opaque();
        const std::string made_by = props.get<std::string>("absorption_from");
        m_made_by = made_by == "color"      ? Absorption::color
                    : made_by == "pigments" ? Absorption::pigments
                                            : Absorption::sigma_a;
    }

    UnpolarizedSpectrum scattered(const BSDFContext &ctx, const SurfaceInteraction3f &si, const Float &theta_i,
                                  const Angles &r, const Float &phi, Mask active) const override {
        return this->value_and_density(ctx, si, theta_i, r, phi, active).first;
    }
    Float density(const BSDFContext &ctx, const SurfaceInteraction3f &si, const Float &theta_i, const Angles &r,
                  const Float &phi, Mask active) const override {
        return this->value_and_density(ctx, si, theta_i, r, phi, active).second;
    }

    void adopt(const HairBSDF<Float, Spectrum> &other) override {
        Base::adopt(other);
        const auto &made = static_cast<const FibreBSDF &>(other);
        for (size_t k = 0; k < m_slots.size(); ++k) {
            Slot &slot = m_slots[k];
            // A value that the user set keeps its gradient; a default that follows it is set here.
            if (!m_textures[k] && !has_gradient(m_values[k]) && slot.made != made.m_slots[k].made &&
                scalar(m_values[k]) == slot.made)
                m_values[k] = made.m_slots[k].made;
            slot.made = made.m_slots[k].made;
            slot.follows = made.m_slots[k].follows;
        }
    }

    // The scene's parameters with textures as they are now, by which Python makes `strand_tables` of their means.
    Properties scene_of_tables() {
        Properties scene(m_scene);
        for (size_t k = 0; k < m_slots.size(); ++k)
            if (m_textures[k]) scene.set(m_slots[k].name, ref<Object>(m_textures[k].get()), false);
        if (m_made_by == Absorption::color) scene.set("color", ref<Object>(m_color.get()), false);
        scene.set("scale", ref<Object>(m_scale.get()), false);
        if (m_made_by == Absorption::sigma_a && !m_attached)
            scene.set(cuticle_mitsuba::strand_tables, ref<Object>(m_sigma_a.get()), false);
        else scene.set(cuticle_mitsuba::strand_tables, true, false);
        return scene;
    }

    // Sets in the scene's parameters what differs from them; whether any does.
    bool set_numbers(Properties &scene) const {
        bool changed = false;
        for (size_t k = 0; k < m_slots.size(); ++k) {
            if (m_textures[k]) continue;
            const ScalarFloat now = scalar(m_values[k]);
            if (now == m_slots[k].made) continue;
            scene.set(m_slots[k].name, double(now), false);
            changed = true;
        }
        return changed;
    }

    // A parameter of f by its place, as the core takes it: angles in radians. A texture is held to the parameter's range.
    Float parameter(size_t k, const SurfaceInteraction3f &si, const Mask &active) const {
        return raw(k, si, active) * m_slots[k].unit;
    }

    UnpolarizedSpectrum absorption(const SurfaceInteraction3f &si, const Mask &active) const {
        UnpolarizedSpectrum made;
        if (m_made_by == Absorption::pigments || (m_pigments && m_attached)) {
            made = raw(m_parameters, si, active) * m_absorption_of[0]->eval(si, active) +
                   raw(m_parameters + 1, si, active) * m_absorption_of[1]->eval(si, active);
        } else if (m_made_by == Absorption::color || (m_color && m_attached)) {
            const UnpolarizedSpectrum color = held(m_color->eval(si, active), ScalarFloat(1e-4), 1);
            made = dr::square(dr::log(color) / cuticle::color_divisor(parameter(roughness, si, active)));
        } else {
            made = m_sigma_a->eval(si, active);
        }
        return held(made * m_scale->eval(si, active), 0, 1000);
    }

    // What the density weighs each channel with.
    static std::array<Float, channels> luminance() {
        std::array<Float, channels> weights;
        for (int c = 0; c < channels; ++c)
            weights[size_t(c)] = is_rgb_v<Spectrum> ? (c == 0 ? .2126f : c == 1 ? .7152f : .0722f) : 1.f / channels;
        return weights;
    }

    bool varies() const { return m_varies; }

  private:
    struct Slot {
        std::string name;
        ScalarFloat low, high, unit;  // its range in the scene's unit, and how many of the core's that is
        ScalarFloat made;             // the number that everything else was made for
        ScalarFloat factor;           // times that of R, which a default follows
        int follows;                  // whose place this is; none where negative
    };

    // Another number is no other kernel.
    void make_opaque() {
        if constexpr (dr::is_jit_v<Float>)
            for (Float &value : m_values) dr::make_opaque(value);
    }

    static bool has_gradient(const Float &x) {
        if constexpr (dr::is_diff_v<Float>) return dr::grad_enabled(x);
        else return false;
    }

    static ScalarFloat scalar(const Float &x) {
        if constexpr (dr::is_jit_v<Float>) {
            if (dr::width(x) != 1) Throw("a fibre's parameter is one number or a texture, got an array of %d", dr::width(x));
            return dr::slice(dr::detach(x), 0);
        } else {
            return x;
        }
    }

    Float raw(size_t k, const SurfaceInteraction3f &si, const Mask &active) const {
        const Slot &slot = m_slots[k];
        if (m_textures[k]) return held(m_textures[k]->eval_1(si, active), slot.low, slot.high);
        if (slot.follows >= 0) return slot.factor * raw(size_t(slot.follows), si, active);
        return m_values[k];
    }

    // What tells the absorption: sigma_a, which numbers of the others have made; or textures.
    enum class Absorption { sigma_a, pigments, color };
    static constexpr size_t roughness = 1;  // beta_n's place, which a colour's absorption depends on

    std::vector<Slot> m_slots;  // of f, then pigments, then densities of strands
    std::vector<Float> m_values;
    std::vector<ref<Texture>> m_textures;  // null where it is a number
    size_t m_parameters, m_pigments;       // how many are f's, and pigments
    ref<Texture> m_color, m_absorption_of[2];
    Absorption m_made_by;
    bool m_attached = false, m_varies;

    MI_TRAVERSE_CB(Base, m_values, m_textures, m_color, m_absorption_of)
};

NAMESPACE_END(mitsuba)
