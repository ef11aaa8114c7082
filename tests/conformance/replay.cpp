// Replays inputs through an exported sampler: rows of theta_i, theta_r, phi, strands and three random numbers in single
// precision; out come the pdf, theta_i and phi of a sample and its pdf in double. With EVAL the scattering function: of
// theta_i, theta_r, phi, strands and, with AROUND, strands behind and whether their numbers are random.
#include "fibre.h"

#include <cstdio>
#include <vector>

#ifdef EVAL
#ifdef AROUND
constexpr int inputs = 6, outputs = fibre::channels;
#else
constexpr int inputs = 4, outputs = fibre::channels;
#endif
void answer(const REAL *x, double *out) {
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
void answer(const REAL *x, double *out) {
    const auto s = fibre::sample(x[1], x[4], x[5], x[6], x[3]);
    out[0] = double(fibre::pdf(x[0], x[1], x[2], x[3]));
    out[1] = double(s.theta_i);
    out[2] = double(s.phi);
    out[3] = double(s.pdf);
}
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
        answer(x, result);
        std::fwrite(result, sizeof result, 1, out);
    }
    std::fclose(in);
    return std::fclose(out) == 0 ? 0 : 4;
}
