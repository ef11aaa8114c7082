// Replays inputs through an exported family: rows of theta_i, theta_r, phi, which of fibres.h, three random numbers, and how
// many strands are around, which PREPARE of fibres.h may ignore; out come f and its density, then theta_i, phi, pdf and f of
// a sample.
#include "fibre.h"
#include "fibres.h"

constexpr int inputs = 8, outputs = 10;

CUTICLE_HD void answer(const REAL *x, double *out) {
    const auto scattering = PREPARE(x[1], fibre_of(static_cast<int>(x[3])), x[7]);
    REAL f[3];
    out[3] = double(scattering.eval(x[0], x[2], f));
    for (int c = 0; c < 3; ++c) out[c] = double(f[c]);
    const auto s = scattering.sample(x[4], x[5], x[6], f);
    out[4] = double(s.theta_i);
    out[5] = double(s.phi);
    out[6] = double(s.pdf);
    for (int c = 0; c < 3; ++c) out[7 + c] = double(f[c]);
}

#include "replay.h"
