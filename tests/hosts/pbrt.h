// What of pbrt-v4 an exported header meets, laid out as there: its files' guards, namespaces, forward declarations, tagged
// pointers over incomplete classes, four wavelengths, flags, and the dispatch that needs whole classes. Compile with -I of
// a folder whose `pbrt/` holds forwarding files (tests/test_examples.py), and define PBRT_EXPORT as the header to include.
#pragma once
#include <array>
#include <cmath>
#include <cstddef>
#include <initializer_list>
#include <optional>
#include <string>
#include <tuple>
#include <type_traits>

#define PBRT_CPU_GPU
namespace pstd {
using std::optional;
}
namespace pbrt {
using Float = float;
constexpr int NSpectrumSamples = 4;

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
inline Float Dot(Vector3f a, Vector3f b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vector3f Normalize(Vector3f a) {
    const Float length = std::sqrt(Dot(a, a));
    return {a.x / length, a.y / length, a.z / length};
}
struct Frame {
    Vector3f x, y, z;
};

class SampledWavelengths {
  public:
    Float operator[](int i) const { return 400 + 100 * Float(i); }
};
class SampledSpectrum {
  public:
    explicit SampledSpectrum(Float v) { values.fill(v); }
    Float operator[](int i) const { return values[size_t(i)]; }
    Float &operator[](int i) { return values[size_t(i)]; }
    SampledSpectrum operator/(Float d) const {
        SampledSpectrum s = *this;
        for (Float &v : s.values) v /= d;
        return s;
    }

  private:
    std::array<Float, NSpectrumSamples> values{};
};
class RGB {
  public:
    RGB(Float r_, Float g_, Float b_) : r(r_), g(g_), b(b_) {}
    Float r, g, b;
};
class RGBColorSpace {
  public:
#ifndef PBRT_IS_GPU_CODE  // device code cannot read a host's static member
    static const RGBColorSpace *sRGB;
#endif
};
inline RGBColorSpace own_space{};
#ifdef PBRT_IS_GPU_CODE
inline RGBColorSpace *RGBColorSpace_sRGB = &own_space;
#else
inline const RGBColorSpace *RGBColorSpace::sRGB = &own_space;
#endif
class RGBUnboundedSpectrum {
  public:
    RGBUnboundedSpectrum(const RGBColorSpace &, RGB c) : rgb(c) {}
    SampledSpectrum Sample(const SampledWavelengths &lambda) const {  // blue, green, red, and red again
        SampledSpectrum s(0);
        for (int i = 0; i < NSpectrumSamples; ++i) s[i] = lambda[i] < 450 ? rgb.b : lambda[i] < 550 ? rgb.g : rgb.r;
        return s;
    }

  private:
    RGB rgb;
};

enum class TransportMode { Radiance, Importance };
enum class BxDFReflTransFlags { Unset = 0, Reflection = 1, Transmission = 2, All = 3 };
inline int operator&(BxDFReflTransFlags a, BxDFReflTransFlags b) { return int(a) & int(b); }
enum BxDFFlags { Reflection = 1, Transmission = 2, Diffuse = 4, Glossy = 8, GlossyReflection = Glossy | Reflection };
struct BSDFSample {
    BSDFSample(SampledSpectrum f_, Vector3f w, Float p, BxDFFlags g, Float e = 1, bool proportional = false)
        : f(f_), wi(w), pdf(p), flags(g), eta(e), pdfIsProportional(proportional) {}
    SampledSpectrum f;
    Vector3f wi;
    Float pdf;
    BxDFFlags flags;
    Float eta;
    bool pdfIsProportional;
};

template <class... Ts> class TaggedPointer {
  public:
    TaggedPointer() = default;
    template <class T> TaggedPointer(T *p) : pointer(p), tag(Index<T>()) {}
    template <class T> static constexpr int Index() {
        static_assert((std::is_same_v<T, Ts> || ...), "the class is not among the tagged pointer's types");
        int i = 0;
        static_cast<void>(((std::is_same_v<T, Ts> || (++i, false)) || ...));
        return i;
    }
    template <class F> auto Dispatch(F f) const { return Next<F, Ts...>(f, 0); }

  private:
    template <class F, class T, class... Rest> auto Next(F f, int i) const {
        if constexpr (sizeof...(Rest) > 0) return i == tag ? f(static_cast<T *>(pointer)) : Next<F, Rest...>(f, i + 1);
        else return f(static_cast<T *>(pointer));
    }
    void *pointer = nullptr;
    int tag = 0;
};

struct Texture {  // of one value everywhere, or none
    const Float *value = nullptr;
    Texture(std::nullptr_t) {}
    explicit Texture(const Float *v) : value(v) {}
    explicit operator bool() const { return value != nullptr; }
    bool operator!=(std::nullptr_t) const { return value != nullptr; }
};
struct FloatTexture : Texture {
    using Texture::Texture;
};
struct SpectrumTexture : Texture {
    using Texture::Texture;
};
enum class SpectrumType { Illuminant, Albedo, Unbounded };
struct UniversalTextureEvaluator {
    bool CanEvaluate(std::initializer_list<FloatTexture>, std::initializer_list<SpectrumTexture>) const { return true; }
    template <class Context> Float operator()(FloatTexture t, const Context &) const { return *t.value; }
    template <class Context>
    SampledSpectrum operator()(SpectrumTexture t, const Context &, const SampledWavelengths &) const {
        return SampledSpectrum(*t.value);
    }
};
class Image;
struct MaterialEvalContext;
struct Allocator {
    template <class T> T *new_object() { return new T(); }
};

#ifndef PBRT_NOT_DECLARED
class BrownHairBxDF;
class BrownHairMaterial;
#endif
class StrandsHairBxDF;
class StrandsHairMaterial;
}  // namespace pbrt
