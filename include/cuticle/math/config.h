// Cuticle core: annotations that every header shares. No dependency, no allocation, no exceptions.
#ifndef CUTICLE_MATH_CONFIG_H
#define CUTICLE_MATH_CONFIG_H

#if defined(__CUDACC__) || defined(__HIPCC__)
#define CUTICLE_HD __host__ __device__
#else
#define CUTICLE_HD
#endif

// For the small functions that must vanish into a loop over lobes for it to be fast.
#if defined(__GNUC__) && !defined(__CUDACC__) && !defined(__HIPCC__)
#define CUTICLE_INLINE inline __attribute__((always_inline))
#else
#define CUTICLE_INLINE CUTICLE_HD inline
#endif

// Loops over the vectors of a pack: taken one by one even where the compiler would not (GCC at -O2), they stay in registers.
#if defined(__GNUC__) && !defined(__CUDACC__) && !defined(__HIPCC__)
#define CUTICLE_UNROLL _Pragma("GCC unroll 16")
#else
#define CUTICLE_UNROLL
#endif

// Whether this pass compiles for a GPU, where an array indexed by a variable lies in slow memory.
#if defined(__CUDA_ARCH__) || defined(__HIP_DEVICE_COMPILE__)
#define CUTICLE_DEVICE 1
#else
#define CUTICLE_DEVICE 0
#endif

// Whether a comparison with NaN is false, as the language has it; -ffast-math and /fp:fast let the compiler assume otherwise.
#if (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__) || defined(_M_FP_FAST)
#define CUTICLE_ORDERS_NAN 0
#else
#define CUTICLE_ORDERS_NAN 1
#endif

#define CUTICLE_VERSION_MAJOR 0
#define CUTICLE_VERSION_MINOR 1
#define CUTICLE_VERSION_PATCH 0

#endif  // CUTICLE_MATH_CONFIG_H
