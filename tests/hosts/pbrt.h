// The few types of pbrt-v4 that examples/pbrt.md meets, so that its code compiles where pbrt is not.
#pragma once
#include <array>
#include <cmath>
#include <optional>
#include <string>

#define PBRT_CPU_GPU
using Float = float;
namespace pstd {
using std::optional;
}
struct Vector3f {
    Float x = 0, y = 0, z = 0;
    Vector3f() = default;
    Vector3f(Float a, Float b, Float c) : x(a), y(b), z(c) {}
};
struct Point2f {
    Float x, y;
    Float operator[](int i) const { return i ? y : x; }
};
inline Float AbsCosTheta(Vector3f w) { return std::abs(w.z); }
enum class TransportMode { Radiance, Importance };
enum class BxDFReflTransFlags { All };
enum class BxDFFlags { GlossyReflection };
struct SampledWavelengths {};
struct SampledSpectrum {
    std::array<Float, 3> values{};
    explicit SampledSpectrum(Float v) { values.fill(v); }
    SampledSpectrum operator/(Float d) const {
        SampledSpectrum s = *this;
        for (Float &v : s.values) v /= d;
        return s;
    }
};
struct RGB {
    Float r, g, b;
    RGB(Float r_, Float g_, Float b_) : r(r_), g(g_), b(b_) {}
};
struct RGBColorSpace {
    static const RGBColorSpace *sRGB;
};
inline const RGBColorSpace own_space{};
inline const RGBColorSpace *RGBColorSpace::sRGB = &own_space;
struct RGBUnboundedSpectrum {
    RGB rgb;
    RGBUnboundedSpectrum(const RGBColorSpace &, RGB c) : rgb(c) {}
    SampledSpectrum Sample(const SampledWavelengths &) const {
        SampledSpectrum s(0);
        s.values = {rgb.r, rgb.g, rgb.b};
        return s;
    }
};
struct BSDFSample {
    SampledSpectrum f;
    Vector3f wi;
    Float pdf;
    BxDFFlags flags;
    BSDFSample(SampledSpectrum f_, Vector3f w, Float p, BxDFFlags g) : f(f_), wi(w), pdf(p), flags(g) {}
};
