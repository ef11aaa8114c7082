// How the dual scattering integrator and the BSDF agree: the context says that a strand stands among others, and the
// interaction carries how many.
#pragma once

#include <mitsuba/render/bsdf.h>
#include <mitsuba/render/interaction.h>

namespace cuticle_mitsuba {

// Bits of the context's type mask that no lobe type has: a strand stands among others; only a direction is asked for; how
// many others is what a density expects; instead of f, what hair passes on of light from wo that met this strand.
constexpr uint32_t among_strands_bit = 1u << 31, direction_only_bit = 1u << 30, expected_bit = 1u << 29;
constexpr uint32_t transmittance_bit = 1u << 28;

// Flags of the BSDF that none of Mitsuba's has: it answers to such a context; it knows its mean over what is expected.
constexpr uint32_t hair_flag = 1u << 31, mean_flag = 1u << 30;

// The parameter by whose change a BSDF is asked to make what it needs for that.
constexpr const char *strand_tables = "strand_tables";

inline mitsuba::BSDFContext among_strands_context(uint32_t bits = 0) {
    mitsuba::BSDFContext context;
    context.type_mask |= among_strands_bit | bits;
    return context;
}
inline bool has_bit(const mitsuba::BSDFContext &context, uint32_t bit) {
    return context.type_mask != uint32_t(-1) && (context.type_mask & bit);
}
inline bool among_strands(const mitsuba::BSDFContext &context) { return has_bit(context, among_strands_bit); }
inline bool direction_only(const mitsuba::BSDFContext &context) { return has_bit(context, direction_only_bit); }
inline bool transmittance(const mitsuba::BSDFContext &context) { return has_bit(context, transmittance_bit); }
inline bool expected(const mitsuba::BSDFContext &context) { return has_bit(context, expected_bit); }

// What the interaction carries, where texture differentials travel, which no ray to a light has.
template <class Float> struct Around {
    Float strands;   // between it and the light: counted, or drawn about what is expected
    Float expected;  // of their number, with the context's expected_bit
    Float behind;    // expected beyond it, away from the light
};
template <class Interaction> auto around(const Interaction &si) {
    using Float = std::decay_t<decltype(si.duv_dx.x())>;
    return Around<Float>{si.duv_dx.x(), si.duv_dx.y(), si.duv_dy.x()};
}
template <class Interaction, class Float> void set_around(Interaction &si, const Around<Float> &a) {
    si.duv_dx = {a.strands, a.expected};
    si.duv_dy = {a.behind, Float(0)};
}

}  // namespace cuticle_mitsuba
