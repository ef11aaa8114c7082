// Replays inputs through an exported family: rows of theta_i, theta_r, phi, which of FIBRES, and three random numbers in
// single precision; out come f and its density, then theta_i, phi, pdf and f of a sample, in double.
#include "fibre.h"

#include <cstdio>

#include "fibres.h"

constexpr int inputs = 8, outputs = 10;

CUTICLE_HD void answer(const REAL *x, const fibre::Fibre<REAL> &parameters, double *out) {
    const auto scattering = fibre::prepare(x[1], parameters);
    REAL f[3];
    out[3] = double(scattering.eval(x[0], x[2], f));
    for (int c = 0; c < 3; ++c) out[c] = double(f[c]);
    const auto s = scattering.sample(x[4], x[5], x[6], f);
    out[4] = double(s.theta_i);
    out[5] = double(s.phi);
    out[6] = double(s.pdf);
    for (int c = 0; c < 3; ++c) out[7 + c] = double(f[c]);
}

#ifdef __CUDACC__
__global__ void replay(const REAL *x, fibre::Fibre<REAL> parameters, double *out) { answer(x, parameters, out); }
void ask(const REAL *x, const fibre::Fibre<REAL> &parameters, double *out) {
    static REAL *in = nullptr;
    static double *result = nullptr;
    if (!in) {
        cudaMalloc(&in, inputs * sizeof(REAL));
        cudaMalloc(&result, outputs * sizeof(double));
    }
    cudaMemcpy(in, x, inputs * sizeof(REAL), cudaMemcpyHostToDevice);
    replay<<<1, 1>>>(in, parameters, result);
    cudaMemcpy(out, result, outputs * sizeof(double), cudaMemcpyDeviceToHost);
}
#else
void ask(const REAL *x, const fibre::Fibre<REAL> &parameters, double *out) { answer(x, parameters, out); }
#endif

int main(int argc, char **argv) {
    if (argc != 3) return 2;
    std::FILE *in = std::fopen(argv[1], "rb"), *out = std::fopen(argv[2], "wb");
    if (!in || !out) return 3;
    float row[inputs];
    while (std::fread(row, sizeof row, 1, in) == 1) {
        REAL x[inputs];
        for (int i = 0; i < inputs; ++i) x[i] = REAL(row[i]);
        double result[outputs];
        ask(x, fibre_of(static_cast<int>(row[3])), result);
        std::fwrite(result, sizeof result, 1, out);
    }
    std::fclose(in);
    return std::fclose(out) == 0 ? 0 : 4;
}
