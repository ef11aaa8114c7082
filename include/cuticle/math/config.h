// Cuticle core: annotations and the standard library, which every header shares. No other dependency, no allocation, no
// exceptions.
#ifndef CUTICLE_MATH_CONFIG_H
#define CUTICLE_MATH_CONFIG_H

#ifdef __CUDACC_RTC__  // NVRTC does not read the host's library; CUDA's is in the toolkit's include/cccl
#include <cuda/std/cmath>
#include <cuda/std/cstddef>
#include <cuda/std/cstdint>
#include <cuda/std/cstring>
#include <cuda/std/limits>
#include <cuda/std/type_traits>
#include <cuda/std/utility>
namespace cuticle {
namespace std = ::cuda::std;
}
#else
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <type_traits>
#include <utility>
#endif

#if __cplusplus < 201703L && !(defined(_MSVC_LANG) && _MSVC_LANG >= 201703L)
#error "Cuticle needs C++17: -std=c++17, or /std:c++17"
#endif
#if defined(min) || defined(max)
#error "Cuticle needs min and max as names, which are macros here: define NOMINMAX before windows.h"
#endif

#if defined(__CUDACC__) || defined(__HIPCC__)
#define CUTICLE_HD __host__ __device__
#else
#define CUTICLE_HD
#endif

// For small functions that must be inlined: a loop over lobes is fast only where it makes no calls. Code for traced arrays
// gains nothing by it, and may define it as `inline` before this header to compile in a fifth of the time.
#ifdef CUTICLE_INLINE
#elif defined(__GNUC__) && !defined(__CUDACC__) && !defined(__HIPCC__)
#define CUTICLE_INLINE inline __attribute__((always_inline))
#else
#define CUTICLE_INLINE CUTICLE_HD inline
#endif

// Unrolls a loop over a pack's vectors, which keeps them in registers. GCC at -O2 would not do so by itself.
#if defined(__GNUC__) && !defined(__CUDACC__) && !defined(__HIPCC__)
#define CUTICLE_UNROLL _Pragma("GCC unroll 16")
#else
#define CUTICLE_UNROLL
#endif

// Whether this pass compiles for a GPU, where an array indexed at run time is placed in slow memory.
#if defined(__CUDA_ARCH__) || defined(__HIP_DEVICE_COMPILE__)
#define CUTICLE_DEVICE 1
#else
#define CUTICLE_DEVICE 0
#endif

// Constants within a function.
#if CUTICLE_DEVICE
#define CUTICLE_CONSTANTS constexpr
#else
#define CUTICLE_CONSTANTS static constexpr
#endif

// Whether a comparison with NaN is false, as the language requires; -ffast-math and /fp:fast drop that guarantee.
#if (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__) || defined(_M_FP_FAST)
#define CUTICLE_ORDERS_NAN 0
#else
#define CUTICLE_ORDERS_NAN 1
#endif

#define CUTICLE_VERSION_MAJOR 0
#define CUTICLE_VERSION_MINOR 1
#define CUTICLE_VERSION_PATCH 0

#endif  // CUTICLE_MATH_CONFIG_H
