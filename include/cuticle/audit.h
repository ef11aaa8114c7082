/* The functions that `cuticle audit libmine.so` calls in a shared library of yours, to test that your sampler draws what its
   pdf claims. Plain C, no other header of Cuticle is needed. docs/audit.md has an example.

   Directions are unit vectors, away from the strand, in a frame of your choice: the strand runs along x, y or z, and
   `--frame` says which. `viewer` is one direction, x, y, z, that all `count` samples share; its azimuth is 0 in that frame.
   Arrays are contiguous: `direction` holds count times x, y, z. A function writes `count` rows, no more; it may be called
   from one thread at a time, any number of times. What is random comes from `u`: the same `u` must give the same directions.
 */
#ifndef CUTICLE_AUDIT_H
#define CUTICLE_AUDIT_H

#include <stddef.h>

#if defined(_WIN32)
#define CUTICLE_AUDIT_EXPORT __declspec(dllexport)
#else
#define CUTICLE_AUDIT_EXPORT __attribute__((visibility("default")))
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* Draws directions toward the light. u: count times 3 numbers in [0, 1). pdf: per steradian; 0 says that a sample has no
   direction, as where a microfacet reflects below a surface. */
CUTICLE_AUDIT_EXPORT void cuticle_audit_sample(size_t count, const double *viewer, const double *u, double *direction,
                                               double *pdf);

/* The density of any directions, per steradian. */
CUTICLE_AUDIT_EXPORT void cuticle_audit_pdf(size_t count, const double *viewer, const double *direction, double *pdf);

/* Optional: f times the cosine that your renderer multiplies it with (for hair cos(theta_i)), in 1/sr, count times red,
   green, blue. Without it there is no test of weights, and no effective sample size. */
CUTICLE_AUDIT_EXPORT void cuticle_audit_eval(size_t count, const double *viewer, const double *direction, double *f_cos);

#ifdef __cplusplus
}
#endif

#endif
