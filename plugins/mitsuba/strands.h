// How the dual scattering integrator and the BSDF agree: the context says that a strand stands among others, and the
// interaction carries how many lie between it and the light.
#pragma once

#include <mitsuba/render/bsdf.h>
#include <mitsuba/render/interaction.h>

namespace cuticle_mitsuba {

// Bits of the context's type mask that no lobe type has: a strand stands among others; only a direction is asked for.
constexpr uint32_t among_strands_bit = 1u << 31, direction_only_bit = 1u << 30;

// A flag of the BSDF that none of Mitsuba's has: it answers to such a context.
constexpr uint32_t hair_flag = 1u << 31;

inline mitsuba::BSDFContext among_strands_context(bool direction_only = false) {
    mitsuba::BSDFContext context;
    context.type_mask |= among_strands_bit | (direction_only ? direction_only_bit : 0u);
    return context;
}
inline bool has_bit(const mitsuba::BSDFContext &context, uint32_t bit) {
    return context.type_mask != uint32_t(-1) && (context.type_mask & bit);
}
inline bool among_strands(const mitsuba::BSDFContext &context) { return has_bit(context, among_strands_bit); }
inline bool direction_only(const mitsuba::BSDFContext &context) { return has_bit(context, direction_only_bit); }

// The count travels where texture differentials do, which no ray to a light has.
template <class Interaction> auto strands(const Interaction &si) { return si.duv_dx.x(); }
template <class Interaction, class Float> void set_strands(Interaction &si, const Float &n) { si.duv_dx = {n, Float(0)}; }

}  // namespace cuticle_mitsuba
