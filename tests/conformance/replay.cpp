// Replays inputs through an exported sampler: rows of theta_i, theta_r, phi, strands and three random numbers in single
// precision; out come the pdf, theta_i and phi of a sample and its pdf in double.
#include "fibre.h"

#include <cstdio>
#include <vector>

int main(int argc, char **argv) {
    if (argc != 3) return 2;
    std::FILE *in = std::fopen(argv[1], "rb"), *out = std::fopen(argv[2], "wb");
    if (!in || !out) return 3;
    float row[7];
    while (std::fread(row, sizeof row, 1, in) == 1) {
        REAL x[7];
        for (int i = 0; i < 7; ++i) x[i] = REAL(row[i]);
        const auto s = fibre::sample(x[1], x[4], x[5], x[6], x[3]);
        const double result[] = {double(fibre::pdf(x[0], x[1], x[2], x[3])), double(s.theta_i), double(s.phi),
                                 double(s.pdf)};
        std::fwrite(result, sizeof result, 1, out);
    }
    std::fclose(in);
    return std::fclose(out) == 0 ? 0 : 4;
}
