// The few types of Cycles that examples/cycles.md meets, so that its code compiles where Cycles is not.
#pragma once
#include <cmath>

#define CCL_NAMESPACE_BEGIN namespace ccl {
#define CCL_NAMESPACE_END }
#define ccl_device inline
#define ccl_device_inline inline
#define ccl_private
namespace ccl {
struct float3 {
    float x, y, z, w;
};
using Spectrum = float3;
inline float3 make_float3(float x, float y, float z) { return {x, y, z, 0}; }
inline float3 operator*(float3 a, float s) { return {a.x * s, a.y * s, a.z * s, 0}; }
inline float3 operator+(float3 a, float3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z, 0}; }
inline float dot(float3 a, float3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline float3 cross(float3 a, float3 b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x, 0}; }
inline float3 safe_normalize(float3 a) {
    const float length = std::sqrt(dot(a, a));
    return length > 0 ? a * (1 / length) : a;
}
using KernelGlobals = const void *;
inline float3 rec709_to_rgb(KernelGlobals, float3 rec709) {
    return rec709 * 2;
}  // doubles, to be noticed where it is left out
inline Spectrum rgb_to_spectrum(float3 rgb) { return rgb; }
struct ShaderData {
    float3 wi, dPdu;
};
enum { LABEL_TRANSMIT = 1, LABEL_REFLECT = 2, LABEL_GLOSSY = 8 };
enum { SD_BSDF = 4, SD_BSDF_HAS_EVAL = 16, SD_BSDF_HAS_TRANSMISSION = 64 };
enum ClosureType { CLOSURE_NONE_ID, CLOSURE_BSDF_HAIR_BROWN_ID };
#define SHADER_CLOSURE_BASE \
    Spectrum weight;        \
    ClosureType type;       \
    float sample_weight;    \
    float3 N
}  // namespace ccl
