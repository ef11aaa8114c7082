// Any bits in any argument: nothing is read out of bounds, and every answer is NaN or at least 0. Compiled with the address
// and undefined-behaviour sanitizers; tables lie on the heap, each to its last value. With -ffast-math only the bounds hold.
#include "cuticle/cuticle.h"

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <limits>
#include <memory>
#include <random>
#include <vector>

namespace {

std::mt19937_64 rng(20);

template <class Float> Float uniform(double lo, double hi) {
    return Float(std::uniform_real_distribution<double>(lo, hi)(rng));
}

// Within its range, any bits at all, or one of those that go wrong most often.
template <class Float> Float argument(double lo, double hi) {
    using Bits = std::conditional_t<sizeof(Float) == 4, std::uint32_t, std::uint64_t>;
    using limits = std::numeric_limits<Float>;
    const Float odd[] = {
        limits::quiet_NaN(), -limits::quiet_NaN(), limits::infinity(), -limits::infinity(), limits::max(), limits::lowest(),
        limits::min(),       limits::denorm_min(), Float(0),           -Float(0),           Float(1),      Float(1.5707964),
        Float(-1.5707964),   Float(3.2e9)};
    const auto kind = rng() % 4;
    if (kind == 0) return odd[rng() % std::size(odd)];
    if (kind > 1) return uniform<Float>(lo, hi);
    const Bits bits = static_cast<Bits>(rng());
    Float x;
    std::memcpy(&x, &bits, sizeof x);
    return x;
}
template <class Float> std::vector<Float> arguments(std::size_t count, double lo, double hi) {
    std::vector<Float> x(count);
    for (Float &v : x) v = argument<Float>(lo, hi);
    return x;
}
template <class Float> std::unique_ptr<Float[]> table(std::size_t count, double lo, double hi) {
    std::unique_ptr<Float[]> x(new Float[count]);
    for (std::size_t i = 0; i < count; ++i) x[i] = uniform<Float>(lo, hi);
    return x;
}

long wrong = 0, usable = 0;
template <class Float> void expect_density(const char *what, Float x) {
    usable += std::isfinite(x);
    if (!CUTICLE_ORDERS_NAN || std::isnan(x) || x >= Float(0)) return;
    if (++wrong <= 20) std::printf("%s: %g\n", what, double(x));
}
template <class Float> void expect_angle(const char *what, Float x, Float limit) {
    if (!CUTICLE_ORDERS_NAN || std::isnan(x) || std::abs(x) <= limit) return;
    if (++wrong <= 20) std::printf("%s: %g\n", what, double(x));
}

template <class Float, int K> void samplers(bool even, std::size_t rows, std::size_t count) {
    const std::size_t nodes = 5;
    const Float all[] = {0, 1, 4};
    const auto strands = table<Float>(rows, 0, 1), energy = table<Float>(rows * nodes, .1, 1);
    std::copy(all, all + rows, strands.get());
    const auto data = table<Float>(rows * nodes * cuticle::lobe_parameters * K, .2, 1.5);
    for (std::size_t node = 0; node < rows * nodes; ++node) {
        Float *weight = data.get() + node * cuticle::lobe_parameters * K, sum = 0;
        for (int k = 0; k < K; ++k) sum += weight[k];
        for (int k = 0; k < K; ++k) weight[k] /= sum;
    }
    const cuticle::LobeTable<Float, K> view{data.get(), energy.get(), strands.get(), int(rows), int(nodes), even};
    const auto ti = arguments<Float>(count, -1.6, 1.6), tr = arguments<Float>(count, -1.6, 1.6);
    const auto phi = arguments<Float>(count, -7, 7), n = arguments<Float>(count, 0, 6);
    const auto u = arguments<Float>(count, 0, 1), v = arguments<Float>(count, 0, 1), w = arguments<Float>(count, 0, 1);
    std::vector<Float> p(count), a(count), b(count);
    cuticle::pdf_batch(view, count, ti.data(), tr.data(), phi.data(), n.data(), true, p.data());
    for (std::size_t i = 0; i < count; ++i) {
        expect_density("pdf_batch", p[i]);
        const Float one = cuticle::pdf(view, ti[i], tr[i], phi[i], n[i]);
        expect_density("pdf", one);
        if (std::isnan(tr[i]) || (std::isnan(n[i]) && rows > 1)) wrong += one > Float(0) || p[i] > Float(0);
        const auto s = cuticle::sample(view, tr[i], u[i], v[i], w[i], n[i]);
        expect_density("sample's pdf", s.pdf);
        expect_angle("theta_i", s.theta_i, Float(1.5707964));
        expect_angle("phi", s.phi, Float(3.1415928));
    }
    cuticle::sample_batch(view, count, tr.data(), u.data(), v.data(), w.data(), n.data(), true, a.data(), b.data(),
                          p.data());
    for (std::size_t i = 0; i < count; ++i) {
        expect_density("sample_batch's pdf", p[i]);
        expect_angle("theta_i of a batch", a[i], Float(1.5707964));
        expect_angle("phi of a batch", b[i], Float(3.1415928));
    }
}

template <class Float> void functions(std::size_t count) {
    constexpr int channels = 2, rows = 4, columns = 5, averages = 6;
    const auto direct = table<Float>(rows * columns * cuticle::lobe_count * channels, 0, 1);
    const auto spread = table<Float>(rows * columns * cuticle::lobe_count * channels, 0, 1);
    const auto mean = table<Float>(averages * channels * cuticle::average_columns, .01, .3);
    const auto rest = table<Float>(rows * channels, 0, 1);
    constexpr int parts = 2 * cuticle::strand_nodes * cuticle::through_parts * channels;
    const auto light = table<Float>(parts * cuticle::energy_columns * 5, .1, .5),
               along = table<Float>(parts * cuticle::along_columns * 4, .1, .5),
               azimuth = table<Float>(parts * 3 * 7, 0, .3), end = table<Float>(5 * 3 * channels, .1, .9);
    const cuticle::AzimuthalTable<const Float *> n{direct.get(), rows, columns, channels},
        m{spread.get(), rows, columns, channels};
    const cuticle::AbsorptionRange<Float> range{Float(.1), Float(1.3), 0, channels};
    const cuticle::ChiangRest<Float> others{rest.get(), rows, channels, Float(.3)};
    const Float strands[] = {0, 1, 3};
    const auto shape = table<Float>(3 * 4 * 5 * 6 * channels, 0, 1), energy = table<Float>(3 * 7 * channels, -2, 0);
    const cuticle::ChiangFibre<Float> chiang{Float(1.55), Float(.2), {Float(.1), Float(.05), Float(.4), Float(.4)}, {}};
    const Float sigma[] = {Float(.2), Float(.9)};
    for (std::size_t i = 0; i < count; ++i) {
        const Float ti = argument<Float>(-1.6, 1.6), tr = argument<Float>(-1.6, 1.6), phi = argument<Float>(-7, 7);
        const cuticle::Surroundings<Float> around{argument<Float>(0, 9), argument<Float>(0, 9), rng() % 2 == 0};
        Float f[channels];
        const auto check = [&](const char *what) {
            for (const Float x : f) expect_density(what, x);
        };
        for (const auto formulation : {cuticle::Formulation::exact, cuticle::Formulation::zinke2008}) {
            const cuticle::DualScatteringModel<Float> model{
                {{Float(.1), Float(-.05), Float(-.1)},
                 {Float(.1), Float(.05), Float(.2)},
                 cuticle::longitudinal_of(formulation)},
                n,
                m,
                {mean.get(), averages, channels},
                formulation,
                Float(.7),
                Float(.7),
                {light.get(), along.get(), azimuth.get(), end.get(), 5, 4, 3, 7, channels, Float(1.5)}};
            cuticle::AzimuthalTerms<Float> terms[channels];
            cuticle::dual_scattering_terms(model, ti, tr, around, cuticle::mask_all, terms);
            cuticle::dual_scattering_around(model, terms, ti, tr, phi, around, f);
            check("dual scattering");
            const auto between = cuticle::locate(range, argument<Float>(0, 2));
            const auto place = cuticle::locate(n, tr, phi);
            cuticle::add_surroundings(model, between, ti, tr, around, cuticle::mask_all, terms[0]);
            cuticle::sum_around(model, terms[0], place, tr, phi, between, around);
            cuticle::chiang_far_terms(model.fibre, others, ti, tr, cuticle::mask_all, terms);
            cuticle::marschner_around(model.fibre, n, terms, ti, tr, phi, f);
            check("Chiang's far field");
        }
        for (const int counts : {1, 3}) {
            const cuticle::TabulatedModel<Float> model{shape.get(), energy.get(), counts,     4,        7,          5,
                                                       6,           channels,     Float(2.5), Float(2), counts == 1};
            cuticle::tabulated_eval(model, strands, ti, tr, phi, around.strands, f);
            check("a table");
        }
        const auto state =
            cuticle::chiang_state(chiang, tr, argument<Float>(-1, 1), sigma, static_cast<const Float *>(nullptr), channels);
        cuticle::chiang_eval(chiang, state, sigma, channels, cuticle::mask_all, ti, phi, f);
        check("Chiang's near field");
        const auto s =
            cuticle::chiang_sample(chiang, state, argument<Float>(0, 1), argument<Float>(0, 1), argument<Float>(0, 1));
        expect_density("Chiang's pdf", s.pdf);
        expect_angle("Chiang's theta_i", s.theta_i, Float(1.5707964));
        for (const auto form : {cuticle::Azimuthal::normal, cuticle::Azimuthal::logistic}) {
            const auto fibre = cuticle::chiang_fibre(argument<Float>(.05, 1), argument<Float>(.05, 1),
                                                     argument<Float>(-.3, .3), argument<Float>(1.05, 3));
            const Float absorption[] = {argument<Float>(0, 20), argument<Float>(0, 20)}, weights[] = {Float(.5), Float(.5)};
            const auto field = cuticle::far_field<channels>(form, fibre, tr, absorption, weights);
            expect_density("any fibre's density", cuticle::far_eval(form, field, ti, phi, f));
            check("any fibre");
            const auto drawn =
                cuticle::far_sample(form, field, argument<Float>(0, 1), argument<Float>(0, 1), argument<Float>(0, 1), f);
            expect_density("any fibre's pdf", drawn.pdf);
            expect_angle("any fibre's theta_i", drawn.theta_i, Float(1.5707964));
        }
    }
}

template <class Float> void grids(std::size_t count) {
    const auto cells = table<Float>(3 * 4 * 5 * cuticle::density_columns, 0, 1);
    const cuticle::DensityGrid<Float> grid{
        cells.get(), {3, 4, 5}, {Float(-1), Float(-2), Float(0)}, {Float(.5), Float(1), Float(.25)}};
    for (std::size_t i = 0; i < count; ++i) {
        const Float origin[] = {argument<Float>(-2, 2), argument<Float>(-3, 3), argument<Float>(-1, 2)};
        const cuticle::Direction<Float> d{argument<Float>(-1, 1), argument<Float>(-1, 1), argument<Float>(-1, 1)};
        expect_density("strands on the way", cuticle::count_strands(grid, origin, d, argument<Float>(0, 9)));
    }
}

template <class Float> void all(std::size_t count) {
    for (const bool even : {true, false})
        for (const std::size_t rows : {std::size_t(1), std::size_t(3)}) samplers<Float, 4>(even, rows, count);
    functions<Float>(count);
    grids<Float>(count);
}

}  // namespace

int main() {
    all<float>(COUNT);
    all<double>(COUNT);
    if (wrong) std::printf("%ld answers are neither NaN nor a density\n", wrong);
    if (usable < COUNT) std::printf("only %ld answers are finite: this proves nothing\n", usable);
    return wrong != 0 || usable < COUNT;
}
