// Replays inputs through an exported sampler: rows of theta_i, theta_r, phi, strands and three random numbers; out come the
// pdf, theta_i and phi of a sample and its pdf. With EVAL the scattering function: of theta_i, theta_r, phi, strands and,
// with AROUND, strands behind and whether their numbers are random.
#include "fibre.h"

#ifdef EVAL
#ifdef AROUND
constexpr int inputs = 6, outputs = fibre::channels;
#else
constexpr int inputs = 4, outputs = fibre::channels;
#endif
CUTICLE_HD void answer(const REAL *x, double *out) {
    REAL f[outputs];
#ifdef AROUND
    fibre::eval_around(x[0], x[1], x[2], f, x[3], x[4], x[5] > 0);
#else
    fibre::eval(x[0], x[1], x[2], f, x[3]);
#endif
    for (int c = 0; c < outputs; ++c) out[c] = double(f[c]);
}
#else
constexpr int inputs = 7, outputs = 4;
CUTICLE_HD void answer(const REAL *x, double *out) {
    const auto s = fibre::sample(x[1], x[4], x[5], x[6], x[3]);
    out[0] = double(fibre::pdf(x[0], x[1], x[2], x[3]));
    out[1] = double(s.theta_i);
    out[2] = double(s.phi);
    out[3] = double(s.pdf);
}
#endif

#include "replay.h"
