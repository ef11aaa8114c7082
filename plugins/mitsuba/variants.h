// The variants of Mitsuba that the plugins are compiled for.
#pragma once

#include <mitsuba/core/object.h>
#include <mitsuba/core/properties.h>

#define CUTICLE_REGISTER(Name, Variant, ...)   \
    fn(name, Variant, Name<__VA_ARGS__>::Type, \
       [](void *, const Properties &props) -> ref<Object> { return new Name<__VA_ARGS__>(props); });

#define CUTICLE_LLVM drjit::DiffArray<JitBackend::LLVM, float>
#define CUTICLE_CUDA drjit::DiffArray<JitBackend::CUDA, float>

#ifdef CUTICLE_WITHOUT_CUDA  // the machine that it is compiled for has no NVIDIA driver
#define CUTICLE_IF_CUDA(...)
#else
#define CUTICLE_IF_CUDA(...) __VA_ARGS__
#endif

// Whether a plugin's traced variants are compiled apart, with -DCUTICLE_TRACED: there each operation is a call that records
// a line, wherever it is inlined, and inlining nothing halves the time of compiling.
#define CUTICLE_OF_TRACED(Use, Name)                                       \
    Use class Name<CUTICLE_LLVM, Color<CUTICLE_LLVM, 3>>;                  \
    Use class Name<CUTICLE_LLVM, Spectrum<CUTICLE_LLVM, 4>>;               \
    CUTICLE_IF_CUDA(Use class Name<CUTICLE_CUDA, Color<CUTICLE_CUDA, 3>>;) \
    CUTICLE_IF_CUDA(Use class Name<CUTICLE_CUDA, Spectrum<CUTICLE_CUDA, 4>>;)

#ifdef CUTICLE_TRACED
#define CUTICLE_EXPORT_PARTS(Name) CUTICLE_OF_TRACED(template, Name)
#else
#define CUTICLE_EXPORT_PARTS(Name) CUTICLE_OF_TRACED(extern template, Name) CUTICLE_EXPORT_PLUGIN(Name)
#endif

#define CUTICLE_EXPORT_PLUGIN(Name)                                                                          \
    extern "C" MI_EXPORT void init_plugin(std::string_view name, PluginRegisterFn fn) {                      \
        CUTICLE_REGISTER(Name, "scalar_rgb", float, Color<float, 3>)                                         \
        CUTICLE_REGISTER(Name, "scalar_spectral", float, Spectrum<float, 4>)                                 \
        CUTICLE_REGISTER(Name, "llvm_ad_rgb", CUTICLE_LLVM, Color<CUTICLE_LLVM, 3>)                          \
        CUTICLE_REGISTER(Name, "llvm_ad_spectral", CUTICLE_LLVM, Spectrum<CUTICLE_LLVM, 4>)                  \
        CUTICLE_IF_CUDA(CUTICLE_REGISTER(Name, "cuda_ad_rgb", CUTICLE_CUDA, Color<CUTICLE_CUDA, 3>))         \
        CUTICLE_IF_CUDA(CUTICLE_REGISTER(Name, "cuda_ad_spectral", CUTICLE_CUDA, Spectrum<CUTICLE_CUDA, 4>)) \
    }
