// Sampler and scattering function over an array type that is no number: lanes that disagree about rows, blends and lobes
// give what each alone gives.
#include "cuticle/cuticle.h"

#include <cmath>
#include <cstdio>
#include <random>
#include <vector>

namespace simd {

constexpr int width = 8;

template <class T> struct Lanes {
    T v[width];

    Lanes() = default;
    template <class S, class = std::enable_if_t<std::is_arithmetic_v<S>>> explicit Lanes(S x) {
        for (T &y : v) y = static_cast<T>(x);
    }
    template <class S> explicit Lanes(const Lanes<S> &x) {
        for (int i = 0; i < width; ++i) v[i] = static_cast<T>(x.v[i]);
    }
};

#define LANES_OPERATOR(op, R)                                                       \
    template <class T> Lanes<R> operator op(const Lanes<T> &a, const Lanes<T> &b) { \
        Lanes<R> r;                                                                 \
        for (int i = 0; i < width; ++i) r.v[i] = a.v[i] op b.v[i];                  \
        return r;                                                                   \
    }
LANES_OPERATOR(+, T)
LANES_OPERATOR(-, T)
LANES_OPERATOR(*, T)
LANES_OPERATOR(/, T)
LANES_OPERATOR(<, bool)
LANES_OPERATOR(>, bool)
LANES_OPERATOR(<=, bool)
LANES_OPERATOR(>=, bool)
#undef LANES_OPERATOR

#define LANES_FUNCTION(name)                                        \
    template <class T> Lanes<T> name(const Lanes<T> &x) {           \
        Lanes<T> r;                                                 \
        for (int i = 0; i < width; ++i) r.v[i] = std::name(x.v[i]); \
        return r;                                                   \
    }
LANES_FUNCTION(sqrt)
LANES_FUNCTION(log)
LANES_FUNCTION(exp)
LANES_FUNCTION(sin)
LANES_FUNCTION(cos)
LANES_FUNCTION(abs)
LANES_FUNCTION(floor)
LANES_FUNCTION(erf)
LANES_FUNCTION(erfc)
#undef LANES_FUNCTION

template <class T> Lanes<T> operator-(const Lanes<T> &a) { return Lanes<T>(0) - a; }
template <class T> Lanes<T> copysign(const Lanes<T> &a, const Lanes<T> &sign) {
    Lanes<T> r;
    for (int i = 0; i < width; ++i) r.v[i] = std::copysign(a.v[i], sign.v[i]);
    return r;
}
template <class T> Lanes<T> select(const Lanes<bool> &mask, const Lanes<T> &a, const Lanes<T> &b) {
    Lanes<T> r;
    for (int i = 0; i < width; ++i) r.v[i] = mask.v[i] ? a.v[i] : b.v[i];
    return r;
}

}  // namespace simd

namespace cuticle {

template <class T> struct ArrayTraits<simd::Lanes<T>> {
    using Scalar = T;
    using Index = simd::Lanes<int>;
    static Index to_index(const simd::Lanes<T> &x) { return Index(x); }
    template <class Memory> static simd::Lanes<T> gather(const Memory &memory, const Index &index) {
        simd::Lanes<T> r;
        for (int i = 0; i < simd::width; ++i) r.v[i] = T(memory[index.v[i]]);
        return r;
    }
    static bool any(const simd::Lanes<bool> &mask) {
        bool any = false;
        for (const bool m : mask.v) any = any || m;
        return any;
    }
};

}  // namespace cuticle

namespace {

template <class Float, int K> int compare(bool even, const std::vector<Float> &strands, std::mt19937 &rng) {
    using Lanes = simd::Lanes<Float>;
    const int rows = static_cast<int>(strands.size()), nodes = 7;
    const auto uniform = [&](double lo, double hi) { return Float(std::uniform_real_distribution<double>(lo, hi)(rng)); };
    std::vector<Float> table, energy;
    for (int i = 0; i < rows * nodes; ++i) {
        Float parameter[5][K], total = 0;
        for (int k = 0; k < K; ++k) {
            total += parameter[0][k] = uniform(.1, 1);
            parameter[1][k] = uniform(-1.6, 1.6);
            parameter[2][k] = even ? uniform(-.1, 3.2) : uniform(-6, 6);
            parameter[3][k] = uniform(.15, 1);
            parameter[4][k] = uniform(.15, 2);
        }
        for (int k = 0; k < K; ++k) parameter[0][k] /= total;
        for (auto &row : parameter) table.insert(table.end(), row, row + K);
        energy.push_back(uniform(.1, 1));
    }
    const cuticle::LobeTable<Float, K> view{table.data(), energy.data(), strands.data(), rows, nodes, even};
    const Float counts[] = {0, Float(.3), Float(.99), 1, Float(1.7), 2, 3, 100};
    int wrong = 0;
    for (int round = 0; round < 2000; ++round) {
        Lanes theta_r, n, theta_i, phi, u[3];
        for (int i = 0; i < simd::width; ++i) {
            theta_r.v[i] = uniform(-1.57, 1.57);
            n.v[i] = counts[rng() % 8];
            theta_i.v[i] = uniform(-1.5, 1.5);
            phi.v[i] = uniform(-6, 6);
            for (Lanes &x : u) x.v[i] = uniform(.001, .999);
        }
        if (round % 4 == 0) n = Lanes(counts[round / 4 % 8]);  // lanes that agree take the short way
        const auto all = cuticle::prepare(view, theta_r, n);
        const Lanes p = all.pdf(theta_i, phi);
        const auto drawn = all.sample(u[0], u[1], u[2]);
        for (int i = 0; i < simd::width; ++i) {
            const auto one = cuticle::prepare(view, theta_r.v[i], n.v[i]);
            const Float expected = one.pdf(theta_i.v[i], phi.v[i]);
            const auto s = one.sample(u[0].v[i], u[1].v[i], u[2].v[i]);
            // Two roundings of the same formulas: the inverse is steep in the tails, and the pdf next to a pole.
            wrong += !(std::abs(p.v[i] - expected) <= Float(2e-4) * expected + Float(1e-6));
            wrong += !(std::abs(drawn.theta_i.v[i] - s.theta_i) <= Float(2e-4));
            wrong += !(std::abs(std::remainder(drawn.phi.v[i] - s.phi, 2 * cuticle::pi<Float>)) <= Float(2e-3));
            wrong += !(std::abs(drawn.pdf.v[i] - s.pdf) <= Float(5e-2) * s.pdf + Float(1e-5));
        }
    }
    return wrong;
}

// f of made-up tables: it is the look-ups and the branches that are compared.
template <class Float> int compare_model(cuticle::Formulation formulation, std::mt19937 &rng) {
    using Lanes = simd::Lanes<Float>;
    constexpr int rows = 5, columns = 9, channels = 2, inclinations = 11;
    const auto uniform = [&](double lo, double hi) { return Float(std::uniform_real_distribution<double>(lo, hi)(rng)); };
    std::vector<Float> direct, spread, averages;
    for (int i = 0; i < rows * columns * cuticle::lobe_count * channels; ++i) {
        direct.push_back(uniform(.01, 1));
        spread.push_back(uniform(.01, 1));
    }
    for (int i = 0; i < inclinations; ++i)
        for (const double x : {.6, .1, -.02, .03, .15, .2, .1, .05, .4})
            for (int c = 0; c < channels; ++c) averages.push_back(Float(x) * uniform(.8, 1.2));
    constexpr int nodes = 2 * cuticle::strand_nodes, through_rows = 5, azimuth_rows = 3, turns = 7;
    std::vector<Float> energy, along, azimuth, end;
    const auto fill = [&](std::initializer_list<double> middles, std::vector<Float> &table) {
        for (int i = 0; i < nodes * through_rows; ++i)
            for (const double x : middles)
                for (int j = 0; j < cuticle::through_parts * channels; ++j) table.push_back(Float(x + .1 * uniform(-1, 1)));
    };
    fill({-1., .05}, energy);                         // log energy, bend
    fill({.5, .3, 0., .2, .3, .15, -.2, .4}, along);  // two shares, then axis and variance of three M's
    for (int i = 0; i < nodes * azimuth_rows * turns * cuticle::through_parts * channels; ++i)
        azimuth.push_back(uniform(.05, .3));
    for (int i = 0; i < through_rows * 3 * channels; ++i) end.push_back(uniform(.3, .9));
    cuticle::DualScatteringModel<Float> model{};
    model.through = {energy.data(), along.data(), azimuth.data(), end.data(), through_rows,
                     through_rows,  azimuth_rows, turns,          channels,   Float(1.53)};
    model.fibre = {
        {Float(-.1), Float(.05), Float(.15)}, {Float(.15), Float(.08), Float(.3)}, cuticle::longitudinal_of(formulation)};
    model.direct = {direct.data(), rows, columns, channels};
    model.spread = {spread.data(), rows, columns, channels};
    model.averages = {averages.data(), inclinations, channels};
    model.formulation = formulation;
    model.d_f = model.d_b = Float(.7);
    const Float counts[] = {0, Float(.25), 1, Float(1.5), 4, 9};
    int wrong = 0;
    for (int round = 0; round < 4000; ++round) {
        Lanes theta_i, theta_r, phi, n, f[channels];
        for (int i = 0; i < simd::width; ++i) {
            theta_i.v[i] = uniform(-1.5, 1.5);
            theta_r.v[i] = uniform(-1.5, 1.5);
            phi.v[i] = uniform(-6, 6);
            n.v[i] = counts[rng() % 6];
        }
        if (round % 4 == 0) n = Lanes(counts[round / 4 % 6]);
        const int lobes = round % 3 == 0 ? static_cast<int>(cuticle::mask_all) : static_cast<int>(rng() % 16);
        cuticle::AzimuthalTerms<Lanes> terms[channels];
        const bool random = round % 2 == 1;
        const Lanes behind = Lanes(random ? counts[round / 2 % 6] : cuticle::half_space<Float>);
        const cuticle::Surroundings<Lanes> around{n, behind, random};
        cuticle::dual_scattering_terms(model, theta_i, theta_r, around, lobes, terms);
        cuticle::dual_scattering_around(model, terms, theta_i, theta_r, phi, around, f);
        for (int i = 0; i < simd::width; ++i) {
            Float one[channels];
            cuticle::AzimuthalTerms<Float> own[channels];
            const cuticle::Surroundings<Float> here{n.v[i], behind.v[i], random};
            cuticle::dual_scattering_terms(model, theta_i.v[i], theta_r.v[i], here, lobes, own);
            cuticle::dual_scattering_around(model, own, theta_i.v[i], theta_r.v[i], phi.v[i], here, one);
            for (int c = 0; c < channels; ++c)  // exponents of up to 1/variance, in single precision
                wrong += !(std::abs(f[c].v[i] - one[c]) <= Float(1e-3) * one[c] + Float(1e-7));
        }
    }
    return wrong;
}

template <class Float> int run(const char *name) {
    std::mt19937 rng(7);
    int wrong =
        compare_model<Float>(cuticle::Formulation::exact, rng) + compare_model<Float>(cuticle::Formulation::zinke2008, rng);
    for (const bool even : {true, false})
        for (const std::vector<Float> &strands :
             {std::vector<Float>{0}, std::vector<Float>{2}, std::vector<Float>{0, 1, 2, 8}, std::vector<Float>{1, 2, 4}}) {
            wrong += compare<Float, 3>(even, strands, rng);
#ifdef WHOLE
            wrong += compare<Float, 1>(even, strands, rng) + compare<Float, 4>(even, strands, rng);
#endif
        }
    std::printf("%s lanes: %d wrong\n", name, wrong);
    return wrong;
}

}  // namespace

int main() {
#ifdef WHOLE
    return run<float>("float") + run<double>("double") == 0 ? 0 : 1;
#else
    return run<float>("float") == 0 ? 0 : 1;
#endif
}
