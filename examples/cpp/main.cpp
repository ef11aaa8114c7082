// A program around an exported sampler: it draws directions and tests with a chi-square that they follow the pdf.
//
//   cuticle fit brown --strands 0,1,2,4,8 -o brown
//   cuticle export brown --to cpp --name brown -o brown.h
//   c++ -std=c++17 -O2 main.cpp -o main && ./main
#include "brown.h"

#include <cmath>
#include <cstdio>
#include <random>
#include <vector>

namespace {

constexpr int thetas = 40, phis = 80, fine = 6;  // cells, and points along each side of a cell
constexpr double pi = 3.14159265358979323846;

// The probability of every cell: the pdf per steradian times d omega = cos(theta) d theta d phi.
std::vector<double> expected(double theta_r, double strands) {
    std::vector<double> mass(thetas * phis, 0.);
    const double step_theta = pi / (thetas * fine), step_phi = 2 * pi / (phis * fine);
    const auto sampler = brown::prepare(theta_r, strands);  // once for all directions
    for (int i = 0; i < thetas * fine; ++i)
        for (int j = 0; j < phis * fine; ++j) {
            const double theta = (i + .5) * step_theta - pi / 2, phi = (j + .5) * step_phi - pi;
            const double p = sampler.pdf(theta, phi) * std::cos(theta) * step_theta * step_phi;
            mass[static_cast<std::size_t>(i / fine * phis + j / fine)] += p;
        }
    return mass;
}

// How many samples fall into every cell.
std::vector<double> observed(double theta_r, double strands, int count, std::mt19937 &rng) {
    std::vector<double> hits(thetas * phis, 0.);
    std::uniform_real_distribution<double> u(0, 1);
    for (int k = 0; k < count; ++k) {
        const auto s = brown::sample(theta_r, u(rng), u(rng), u(rng), strands);
        const int i = static_cast<int>((s.theta_i / pi + .5) * thetas), j = static_cast<int>((s.phi / pi + 1) / 2 * phis);
        hits[static_cast<std::size_t>(i * phis + (j == phis ? 0 : j))] += 1;
    }
    return hits;
}

// The chi-square statistic as a number of standard deviations (Wilson and Hilferty 1931); cells that expect fewer than 10
// samples are pooled.
double deviations(const std::vector<double> &mass, const std::vector<double> &hits, int count) {
    double sum = 0, pooled_mass = 0, pooled_hits = 0, total = 0;
    int cells = 0;
    const auto add = [&](double m, double h) {
        sum += (h - m * count) * (h - m * count) / (m * count);
        ++cells;
    };
    for (const double m : mass) total += m;
    for (std::size_t k = 0; k < mass.size(); ++k) {
        const double m = mass[k] / total;
        if (m * count >= 10) {
            add(m, hits[k]);
        } else {
            pooled_mass += m;
            pooled_hits += hits[k];
        }
    }
    if (pooled_mass * count >= 10) add(pooled_mass, pooled_hits);
    const double freedom = cells - 1, v = 2 / (9 * freedom);
    return (std::cbrt(sum / freedom) - (1 - v)) / std::sqrt(v);
}

}  // namespace

int main() {
    constexpr int count = 200000;
    constexpr double limit = 4;  // a false-positive rate of 1 in 30,000
    std::mt19937 rng(1);
    bool ok = true;
    std::printf("%d lobes, %d samples a row\n", brown::lobes, count);
    std::printf(" theta_r  strands   integral  deviations\n");
    for (const double degrees : {-75., -30., 0., 60., 85.})
        for (const double strands : {0., .5, 3.}) {
            const double theta_r = degrees * pi / 180;
            const std::vector<double> mass = expected(theta_r, strands);
            double integral = 0;
            for (const double m : mass) integral += m;
            const double z = deviations(mass, observed(theta_r, strands, count, rng), count);
            const bool good = z < limit && std::fabs(integral - 1) < 1e-3;
            std::printf("%7.0f° %8g %10.5f %11.2f%s\n", degrees, strands, integral, z, good ? "" : "  <- does not match");
            ok = ok && good;
        }
    std::printf(ok ? "samples follow the pdf\n" : "the pdf does not describe the samples\n");
    return ok ? 0 : 1;
}
