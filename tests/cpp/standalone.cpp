// The core on its own: compiled with all warnings as errors, float and double through the same lines.
#include "cuticle/cuticle.h"

#include <cmath>
#include <cstdio>
#include <limits>

namespace {

template <class Float> int run() {
    constexpr int k = 2;
    const Float nodes[] = {Float(.6),  Float(.4), Float(1.4), Float(1.2), Float(3.1), Float(1),    Float(.3),
                           Float(.2),  Float(.6), Float(.4),  Float(.5),  Float(.5),  Float(-1.4), Float(-1.2),
                           Float(3.1), Float(2),  Float(.3),  Float(.2),  Float(.6),  Float(.4)};
    const Float energy[] = {Float(1), Float(1)}, strands[] = {Float(0)};
    const cuticle::LobeTable<Float, k> table{nodes, energy, strands, 1, 2, true};
    const auto sampler = cuticle::prepare(table, Float(.3), Float(0));
    // ∫ pdf by the midpoint rule.
    const int n = 400;
    const Float pi = cuticle::pi<Float>;
    double total = 0;
    for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) {
            const Float theta = pi * (Float(i) + Float(.5)) / Float(n) - pi / 2;
            const Float phi = 2 * pi * (Float(j) + Float(.5)) / Float(n) - pi;
            total += double(sampler.pdf(theta, phi)) * std::cos(double(theta)) * double(2 * pi * pi) / (double(n) * n);
        }
    // A sample's pdf is the pdf there, and a direction goes to angles and back.
    int wrong = !(std::abs(total - 1) <= 1e-4);
    for (int i = 0; i < 1000; ++i) {
        const Float u = Float(i) / 1000, v = Float((i * 37) % 1000) / 1000, w = Float((i * 91) % 1000) / 1000;
        const auto s = sampler.sample(u, v, w);
        wrong += !(std::abs(s.pdf - sampler.pdf(s.theta_i, s.phi)) <= Float(1e-4) * s.pdf);
        const auto direction = cuticle::to_direction(s.theta_i, s.phi);
        wrong += !(std::abs(cuticle::theta_of(direction) - s.theta_i) <= Float(1e-3));
        wrong += !(std::abs(cuticle::math::nearest_turn(Float(cuticle::phi_of(direction) - s.phi))) <= Float(1e-3));
    }
    // Hair in wider cells: nothing is lost, and straight through a full box there is as much to meet.
    constexpr int fine[3] = {5, 4, 3}, factor = 2;
    constexpr int wide[3] = {cuticle::coarse_size(fine[0], factor), cuticle::coarse_size(fine[1], factor),
                             cuticle::coarse_size(fine[2], factor)};
    Float cells[5 * 4 * 3 * cuticle::density_columns], wider[3 * 2 * 2 * cuticle::density_columns];
    double before = 0, after = 0;
    for (int i = 0; i < 5 * 4 * 3; ++i)
        for (int c = 0; c < cuticle::density_columns; ++c) {
            cells[i * cuticle::density_columns + c] = c == 0 ? Float(i % 7) : Float(0);  // all along x
            before += double(cells[i * cuticle::density_columns + c]);
        }
    const cuticle::DensityGrid<Float> hair_in_cells{
        cells, {fine[0], fine[1], fine[2]}, {Float(0), Float(0), Float(0)}, {Float(1), Float(1), Float(1)}};
    cuticle::coarsen(hair_in_cells, factor, wider);
    for (const Float &value : wider) after += double(value) * factor * factor * factor;
    wrong += !(std::abs(after - before) <= 1e-4 * before);
    const cuticle::DensityGrid<Float> rough{
        wider, {wide[0], wide[1], wide[2]}, {Float(0), Float(0), Float(0)}, {Float(2), Float(2), Float(2)}};
    const Float from[] = {Float(1), Float(-1), Float(1)};  // between four columns of cells of one wide one
    const cuticle::Direction<Float> up{Float(0), Float(1), Float(0)};
    double through = 0;
    for (const Float &x : {Float(.5), Float(1.5)})
        for (const Float &z : {Float(.5), Float(1.5)}) {
            const Float start[] = {x, Float(-1), z};
            through += .25 * double(cuticle::count_strands(hair_in_cells, start, up, Float(100)));
        }
    wrong += !(std::abs(double(cuticle::count_strands(rough, from, up, Float(100))) - through) <= 2e-4 * through);

    // A viewer that is no number is read within the table, and gives none.
    const volatile Float none = std::numeric_limits<Float>::quiet_NaN();  // known only when it runs
    wrong += !std::isnan(cuticle::pdf(table, Float(.1), Float(none), Float(.2), Float(0)));
    // Chiang's near field: ∫ pdf, and f cos over the pdf is one number where there is one channel.
    cuticle::ChiangFibre<Float> hair{Float(1.55),
                                     Float(.07),
                                     {Float(.08), Float(.02), Float(.32), Float(.32)},
                                     {Float(-.07), Float(.035), Float(.14), Float(0)}};
    const Float sigma_a[] = {Float(.5)}, luminance[] = {Float(1)};
    const auto state = cuticle::chiang_state(hair, Float(.4), Float(.3), sigma_a, luminance, 1);
    double near = 0, carried = 0;
    for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) {
            const Float theta = pi * (Float(i) + Float(.5)) / Float(n) - pi / 2;
            const Float phi = 2 * pi * (Float(j) + Float(.5)) / Float(n) - pi;
            Float f;
            cuticle::chiang_eval(hair, state, sigma_a, 1, cuticle::mask_all, theta, phi, &f);
            const double area = std::cos(double(theta)) * double(2 * pi * pi) / (double(n) * n);
            near += double(cuticle::chiang_pdf(hair, state, theta, phi)) * area;
            carried += double(f) * std::cos(double(theta)) * area;
        }
    wrong += !(std::abs(near - 1) <= 1e-4);
    for (int i = 0; i < 1000; ++i) {
        const Float u = Float(i) / 1000, v = Float((i * 37) % 1000) / 1000, w = Float((i * 91) % 1000) / 1000;
        const auto s = cuticle::chiang_sample(hair, state, u, v, w);
        Float f;
        cuticle::chiang_eval(hair, state, sigma_a, 1, cuticle::mask_all, s.theta_i, s.phi, &f);
        wrong += !(std::abs(double(f) * std::cos(double(s.theta_i)) / double(s.pdf) - carried) <= 1e-3 * carried);
    }
    std::printf("integral %.7f, near field %.7f, %d wrong\n", total, near, wrong);
    return wrong;
}

}  // namespace

namespace {

// The single-precision functions against the library's in double, to the errors that the headers state.
int approximations() {
    double decay = 0, erf = 0, log = 0;
    const auto larger = [](double so_far, double x) { return x > so_far || !(x == x) ? x : so_far; };  // a NaN stays
    for (int i = 1; i <= 200000; ++i) {
        const float x = 59.9f * float(i) / 200000, y = 4.f * float(i) / 200000;
        decay = larger(decay, std::fabs(double(cuticle::math::decay(-x)) / std::exp(-double(x)) - 1));
        erf = larger(erf, std::fabs(double(cuticle::math::erf(y)) / std::erf(double(y)) - 1));
        const double exact = std::log(double(x));
        log = larger(log, std::fabs(double(cuticle::math::log(x)) - exact) / std::fmax(std::fabs(exact), 1.));
    }
    std::printf("relative error: decay %.2g, erf %.2g, log %.2g\n", decay, erf, log);
    return !(decay <= 3e-7) + !(erf <= 4e-7) + !(log <= 2e-7);
}

}  // namespace

int main() { return run<float>() + run<double>() + approximations() == 0 ? 0 : 1; }
