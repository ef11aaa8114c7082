// Every family of lobes tells one story: density, cdf and inverse along a coordinate, a mixture's pdf and samples, in single
// and in double precision, number by number, in packs and over arrays.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include "cuticle/cuticle.h"

namespace {

using cuticle::half_pi;
using cuticle::pi;

int wrong = 0;
template <class... Numbers> void expect(bool held, const char *what, Numbers... about) {
    if (held) return;
    ++wrong;
    std::printf("wrong: %s", what);
    (std::printf(" %.9g", double(about)), ...);
    std::printf("\n");
}

// One density on [lo, hi]. An x is rounded to `grain`, which moves its cdf by grain times the pdf; where a lobe is flat, its
// interval is a small part of what the family's own cdf runs over, of whose digits a part is left.
template <class Family, class Float> void coordinate(Float mean, Float sigma, Float lo, Float hi) {
    const Float eps = cuticle::epsilon<Float>, grain = 4 * eps * (std::abs(mean) + hi - lo);
    const auto d = Family::make(mean, sigma, lo, hi);
    const auto pdf = [&](Float x) { return cuticle::density_norm<Family>(d) * Family::shape(Float((x - d.mean) * d.rate)); };
    const double flat = std::max(1., double(sigma / (hi - lo)));
    // ∫ pdf by the midpoint rule.
    const int n = 20000;
    double total = 0;
    for (int i = 0; i < n; ++i) total += double(pdf(lo + (hi - lo) * (Float(i) + Float(.5)) / n)) * double(hi - lo) / n;
    const double step =
        double(hi - lo) / n / double(sigma);  // what the rule itself is off, at an end where the lobe is steep
    expect(std::abs(total - 1) <= 1e-5 + .1 * step * step + 20 * flat * double(eps), "integral", total, mean, sigma);

    expect(std::abs(Family::cdf(d, lo)) <= 8 * Float(flat) * eps, "cdf at the lower end", Family::cdf(d, lo), mean, sigma);
    expect(std::abs(Family::cdf(d, hi) - 1) <= 8 * Float(flat) * eps, "cdf at the upper end", mean, sigma);
    Float before = lo;
    for (int i = 1; i < 400; ++i) {
        const Float u = Float(i) / 400, x = Family::icdf(d, u, lo, hi);
        const double error = std::abs(double(Family::cdf(d, x)) - double(u));
        expect(error <= 16 * flat * double(eps) + double(grain * pdf(x)), "cdf of the inverse", error, u, mean, sigma);
        expect(x >= lo - grain && x <= hi + grain, "the inverse lies inside", x, u, mean, sigma);
        expect(x >= before - grain * Float(flat), "the inverse rises", x, before, u, mean, sigma);
        before = x;
    }
    // The slope of the logarithm, which fits go by.
    for (const double z : {-6., -1., 0., .3, 4.}) {
        const auto log_shape = [](double at) { return std::log(Family::shape(at)); };
        const double slope = -(log_shape(z + 1e-5) - log_shape(z - 1e-5)) / 2e-5;
        expect(std::abs(Family::fall(z) - slope) <= 1e-6, "fall", z);
    }
}

// Packs give what numbers give.
template <class Family, class Lanes, class Float> void in_packs(Float lo, Float hi) {
    constexpr int n = Lanes::width * Lanes::chunks;
    Lanes mean(0), sigma(1), x(0), u(0);
    for (int i = 0; i < n; ++i) {
        mean.set(i, lo + (hi - lo) * Float(i) / n);
        sigma.set(i, Float(.05) + Float(i) / 5);
        x.set(i, hi - (hi - lo) * Float(i * i) / (n * n));
        u.set(i, (Float(i) + Float(.5)) / n);
    }
    const auto all = Family::make(mean, sigma, Lanes(lo), Lanes(hi));
    const Lanes norm = cuticle::density_norm<Family>(all), shape = Family::shape(Lanes((x - all.mean) * all.rate));
    const Lanes cdf = Family::cdf(all, x), icdf = Family::icdf(all, u, Lanes(lo), Lanes(hi));
    const Float tolerance = 200 * cuticle::epsilon<Float>;
    for (int i = 0; i < n; ++i) {
        const auto one = Family::make(mean[i], sigma[i], lo, hi);
        const Float own = cuticle::density_norm<Family>(one) * Family::shape(Float((x[i] - one.mean) * one.rate));
        expect(std::abs(norm[i] * shape[i] - own) <= tolerance * (own + Float(1e-6)), "pdf in packs", i);
        expect(std::abs(cdf[i] - Family::cdf(one, x[i])) <= tolerance, "cdf in packs", i);
        expect(std::abs(icdf[i] - Family::icdf(one, u[i], lo, hi)) <= tolerance, "inverse in packs", i);
    }
}

// A function of its own: at every call inlined anew, it would be most of what is compiled.
template <class Float, int K, class Family>
[[gnu::noinline]] Float pdf(const cuticle::PreparedSampler<Float, K, Family> &sampler, Float theta_i, Float phi) {
    return sampler.pdf(theta_i, phi);
}

// A mixture at one viewer: ∫ pdf, a sample's pdf, and how many samples lie below an angle. `u` runs through a grid, so that
// counts are off by a cell's share at most.
template <class Family, class Float> void mixture(bool even) {
    constexpr int lobes = 3, n = 500;
    const Float one[] = {Float(.5), Float(.3), Float(.2), Float(.3),  Float(-1.2), Float(1.6), Float(2.9), Float(.4),
                         Float(0),  Float(.2), Float(.6), Float(1.1), Float(.25),  Float(.8),  Float(50)};
    std::vector<Float> nodes(one, one + 15);
    nodes.insert(nodes.end(), one, one + 15);
    const Float energy[] = {1, 1}, strands[] = {0};
    const cuticle::LobeTable<Float, lobes, const Float *, Family> table{nodes.data(), energy, strands, 1, 2, even};
    const auto sampler = cuticle::prepare(table, Float(.2), Float(0));
    double total = 0;
    for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) {
            const Float theta = pi<Float> * (Float(i) + Float(.5)) / n - half_pi<Float>;
            const Float phi = 2 * pi<Float> * (Float(j) + Float(.5)) / n - pi<Float>;
            total += double(pdf(sampler, theta, phi)) * std::cos(double(theta)) * 2 * pi<double> * pi<double> / (n * n);
        }
    expect(std::abs(total - 1) <= 1e-4, "mixture's integral", total, even);

    constexpr std::size_t side = 100, choices = 10, count = side * side * choices;
    std::vector<Float> u[3], viewers(count, Float(.2)), out[3];
    for (auto &x : u) x.resize(count);
    for (auto &x : out) x.resize(count);
    const Float limits[] = {Float(-1.2), Float(-.4), Float(0), Float(.6), Float(1.4)};
    int below[2][5] = {};
    for (std::size_t i = 0; i < count; ++i) {
        u[0][i] = (Float(i / (side * side)) + Float(.5)) / choices;
        u[1][i] = (Float(i / side % side) + Float(.5)) / side;
        u[2][i] = (Float(i % side) + Float(.5)) / side;
        const auto s = sampler.sample(u[0][i], u[1][i], u[2][i]);
        const Float p = pdf(sampler, s.theta_i, s.phi);
        expect(std::abs(s.pdf - p) <= 200 * cuticle::epsilon<Float> * p, "a sample's pdf", s.pdf, p, even);
        for (int j = 0; j < 5; ++j) {
            below[0][j] += s.theta_i < limits[j];
            below[1][j] += s.phi < 2 * limits[j];
        }
    }
    for (int j = 0; j < 5; ++j) {
        double along[2] = {};
        for (int k = 0; k < lobes; ++k) {
            along[0] += double(one[k] * sampler.first.cdf_theta(k, limits[j]));
            along[1] += double(one[k] * sampler.first.cdf_phi(k, 2 * limits[j]));
        }
        for (int i = 0; i < 2; ++i)
            expect(std::abs(double(below[i][j]) / double(count) - along[i]) <= 1.5 / double(side), "share of samples", i, j,
                   even);
    }
    // Over arrays.
    const auto near = [](Float a, Float b) { return std::abs(a - b) <= 400 * cuticle::epsilon<Float> * (b + Float(.01)); };
    cuticle::sample_batch(table, count, viewers.data(), u[0].data(), u[1].data(), u[2].data(), strands, false, out[0].data(),
                          out[1].data(), out[2].data());
    for (std::size_t i = 0; i < count; ++i)
        expect(near(out[2][i], pdf(sampler, out[0][i], out[1][i])), "batch sample", i, even);
    cuticle::pdf_batch(table, count, out[0].data(), viewers.data(), out[1].data(), strands, false, out[2].data());
    for (std::size_t i = 0; i < count; ++i)
        expect(near(out[2][i], pdf(sampler, out[0][i], out[1][i])), "batch pdf", i, even);
    cuticle::pdf_batch(sampler, count, out[0].data(), out[1].data(), out[2].data());
    for (std::size_t i = 0; i < count; ++i)
        expect(near(out[2][i], pdf(sampler, out[0][i], out[1][i])), "pdf of a viewer", i, even);
}

template <class Family, class Float> void all() {
    const Float pole = half_pi<Float>;
    for (const Float sigma : {Float(.005), Float(.1), Float(1), Float(50), Float(1000)})
        for (const Float share : {Float(0), Float(.3), Float(.999), Float(1)}) {
            coordinate<Family, Float>(share * pole, sigma, -pole, pole);
            coordinate<Family, Float>(-share * pole, sigma, -pole, pole);
            coordinate<Family, Float>(share * pi<Float>, sigma, Float(0), pi<Float>);
            coordinate<Family, Float>(pi<Float> + share * sigma, sigma, Float(0), pi<Float>);
            coordinate<Family, Float>(-pole - share * sigma, sigma, -pole, pole);
        }
    in_packs<Family, cuticle::Pack<Float, 4>>(-pole, pole);
    in_packs<Family, cuticle::Pack<Float, 8>>(Float(0), pi<Float>);
    in_packs<Family, cuticle::BatchLanes<Float>>(-pole, pole);
#ifndef WHOLE  // else of every family in both precisions; the normal's is known from standalone.cpp, lanes.cpp, batch.cpp
    if constexpr (!std::is_same_v<Family, cuticle::NormalLobes> && std::is_same_v<Float, float>)
#endif
        for (const bool even : {true, false}) mixture<Family, Float>(even);
}

}  // namespace

int main() {
    cuticle::each_family([](const char *name, auto family) {
        const int before = wrong;
        all<decltype(family), float>();
        all<decltype(family), double>();
        std::printf("%s: %d\n", name, wrong - before);
    });
    return wrong != 0;
}
