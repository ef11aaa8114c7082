// Cuticle core: annotations that every header shares. No dependency, no allocation, no exceptions.
#pragma once

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

#define CUTICLE_VERSION_MAJOR 0
#define CUTICLE_VERSION_MINOR 1
#define CUTICLE_VERSION_PATCH 0
