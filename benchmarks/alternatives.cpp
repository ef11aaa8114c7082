// Times samplers against a calibration kernel, or tells the densities of one: see alternatives.py, which writes the input.
#include "alternatives.h"
#include "timing.h"

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <random>
#include <string>

namespace {

constexpr std::size_t inputs = 65536;  // a wavefront: small ones would time the caches that the case before left

template <class T> std::vector<T> uniform(std::mt19937 &rng, double lo, double hi) {
    std::uniform_real_distribution<double> d(lo, hi);
    std::vector<T> v(inputs);
    for (T &x : v) x = std::min(T(d(rng)), T(std::nextafter(T(hi), T(lo))));
    return v;
}
template <class T> struct Inputs {
    std::vector<T> theta_i, theta_r, phi, u[4], out[3];
    explicit Inputs(std::mt19937 &rng)
        : theta_i(uniform<T>(rng, -1.5, 1.5)), theta_r(uniform<T>(rng, -1.5, 1.5)), phi(uniform<T>(rng, -3.14, 3.14)) {
        for (auto &x : u) x = uniform<T>(rng, 0, 1);
        for (auto &x : out) x.resize(inputs);
    }
};

// Any sampler's pdf and sample, one by one.
template <class T, class Sampler>
void add(std::vector<timing::Case> &cases, const std::string &name, const Inputs<T> &in, const Sampler &sampler) {
    cases.push_back({name + " pdf", [&in, sampler] {
                         T sum = 0;
                         for (std::size_t i = 0; i < inputs; ++i)
                             sum += sampler.pdf(in.theta_i[i], in.theta_r[i], in.phi[i]);
                         return double(sum);
                     }});
    cases.push_back({name + " sample", [&in, sampler] {
                         T sum = 0;
                         for (std::size_t i = 0; i < inputs; ++i) {
                             const auto s = sampler.sample(in.theta_r[i], in.u[0][i], in.u[1][i], in.u[2][i], in.u[3][i]);
                             sum += s.theta_i + s.phi + s.pdf;
                         }
                         return double(sum);
                     }});
}

template <class T, int K> struct Fitted {
    cuticle::LobeTable<T, K> table;
    T strands;
    T pdf(T theta_i, T theta_r, T phi) const { return cuticle::pdf(table, theta_i, theta_r, phi, strands); }
    cuticle::Sample<T> sample(T theta_r, T u, T v, T w, T) const {
        return cuticle::sample(table, theta_r, u, v, w, strands);
    }
};

struct Lobes {
    int lobes, rows, nodes;
    bool even;
    std::vector<double> values, energy, strands;
    std::vector<float> values_f, energy_f, strands_f;
};

template <class T, int K> cuticle::LobeTable<T, K> view(const Lobes &l) {
    if constexpr (std::is_same_v<T, float>)
        return {l.values_f.data(), l.energy_f.data(), l.strands_f.data(), l.rows, l.nodes, l.even};
    else return {l.values.data(), l.energy.data(), l.strands.data(), l.rows, l.nodes, l.even};
}

template <int K>
void add_fitted(std::vector<timing::Case> &cases, const Lobes &l, Inputs<float> &f, Inputs<double> &d,
                const std::string &suffix, float strands) {
    const std::string name = "K=" + std::to_string(K) + suffix;
    add(cases, name + " float", f, Fitted<float, K>{view<float, K>(l), strands});
    add(cases, name + " double", d, Fitted<double, K>{view<double, K>(l), double(strands)});
    const auto table = view<float, K>(l);
    cases.push_back({name + " batch pdf", [&f, table, strands] {
                         cuticle::pdf_batch(table, inputs, f.theta_i.data(), f.theta_r.data(), f.phi.data(), &strands, false,
                                            f.out[0].data());
                         return double(f.out[0][7]);
                     }});
    cases.push_back({name + " batch sample", [&f, table, strands] {
                         cuticle::sample_batch(table, inputs, f.theta_r.data(), f.u[0].data(), f.u[1].data(), f.u[2].data(),
                                               &strands, false, f.out[0].data(), f.out[1].data(), f.out[2].data());
                         return double(f.out[0][7]);
                     }});
    if (l.rows > 1) {  // a number of strands each, whole ones from 0 to 8
        std::vector<float> counts(f.u[3]);
        for (float &n : counts) n = std::floor(9 * n);
        cases.push_back({name + " each pdf", [&f, table, counts] {
                             cuticle::pdf_batch(table, inputs, f.theta_i.data(), f.theta_r.data(), f.phi.data(),
                                                counts.data(), true, f.out[0].data());
                             return double(f.out[0][7]);
                         }});
        cases.push_back({name + " each sample", [&f, table, counts] {
                             cuticle::sample_batch(table, inputs, f.theta_r.data(), f.u[0].data(), f.u[1].data(),
                                                   f.u[2].data(), counts.data(), true, f.out[0].data(), f.out[1].data(),
                                                   f.out[2].data());
                             return double(f.out[0][7]);
                         }});
    }
    // One viewer for all directions: lights around one shading point.
    cases.push_back({name + " prepared pdf", [&f, table, strands] {
                         const auto once = cuticle::prepare(table, .5f, strands);
                         float sum = 0;
                         for (std::size_t i = 0; i < inputs; ++i) sum += once.pdf(f.theta_i[i], f.phi[i]);
                         return double(sum);
                     }});
    cases.push_back({name + " viewer pdf", [&f, table, strands] {
                         cuticle::pdf_batch(cuticle::prepare(table, .5f, strands), inputs, f.theta_i.data(), f.phi.data(),
                                            f.out[0].data());
                         return double(f.out[0][7]);
                     }});
    cases.push_back({name + " viewer sample", [&f, table, strands] {
                         cuticle::sample_batch(cuticle::prepare(table, .5f, strands), inputs, f.u[0].data(), f.u[1].data(),
                                               f.u[2].data(), f.out[0].data(), f.out[1].data(), f.out[2].data());
                         return double(f.out[0][7]);
                     }});
}

}  // namespace

int main(int argc, char **argv) {
    if (argc < 3) {
        std::fprintf(stderr, "usage: alternatives INPUT (time ROUNDS | pdf NAME POINTS OUT)\n");
        return 2;
    }
    timing::Reader reader{argv[1]};
    alternatives::FibreLobes fibre{};
    for (float &x : fibre.alpha) x = reader.real();
    for (float &x : fibre.beta) x = reader.real();
    fibre.conserving = reader.integer() != 0;
    fibre.rows = reader.integer();
    fibre.columns = reader.integer();
    const auto size = std::size_t(3 * fibre.rows * fibre.columns);
    fibre.n = reader.array<float>(size);
    fibre.sums = reader.array<float>(size);
    alternatives::Table table{};
    table.viewers = reader.integer();
    table.thetas = reader.integer();
    table.phis = reader.integer();
    const auto cells = std::size_t(table.viewers * table.thetas * table.phis);
    table.mass = reader.array<float>(cells);
    table.rows = reader.array<float>(std::size_t(table.viewers * table.thetas));
    table.columns = reader.array<float>(cells);

    if (std::string(argv[2]) == "pdf") {
        if (argc != 6) return 2;
        std::FILE *in = std::fopen(argv[4], "rb"), *out = std::fopen(argv[5], "wb");
        if (!in || !out) return 2;
        const std::string name = argv[3];
        float p[3];
        while (std::fread(p, sizeof p, 1, in) == 1) {
            const float density = name == "table" ? table.pdf(p[0], p[1], p[2]) : fibre.pdf(p[0], p[1], p[2]);
            std::fwrite(&density, sizeof density, 1, out);
        }
        std::fclose(in);
        return std::fclose(out) == 0 ? 0 : 3;
    }

    std::mt19937 rng(7);
    Inputs<float> f(rng);
    Inputs<double> d(rng);
    std::vector<Lobes> all(std::size_t(reader.integer()));
    for (Lobes &l : all) {
        l.lobes = reader.integer();
        l.rows = reader.integer();
        l.nodes = reader.integer();
        l.even = reader.integer() != 0;
        const auto n = std::size_t(l.rows * l.nodes);
        l.values = reader.array<double>(n * std::size_t(5 * l.lobes));
        l.energy = reader.array<double>(n);
        l.strands = reader.array<double>(std::size_t(l.rows));
        l.values_f.assign(l.values.begin(), l.values.end());
        l.energy_f.assign(l.energy.begin(), l.energy.end());
        l.strands_f.assign(l.strands.begin(), l.strands.end());
    }
    std::vector<timing::Case> cases;
    cases.push_back({"calibration", [&f] {
                         float sum = 0;
                         for (std::size_t i = 0; i < inputs; ++i)
                             for (std::size_t k = 0; k < 16; ++k)
                                 sum += std::exp(f.theta_i[(i + k) & (inputs - 1)] - f.u[0][i]);
                         return double(sum);
                     }});
    add(cases, "uniform", f, alternatives::Uniform{});
    // Through pointers: a copy of the tables a case would measure the cache.
    struct Reference {
        const alternatives::FibreLobes *fibre;
        float pdf(float a, float b, float c) const { return fibre->pdf(a, b, c); }
        cuticle::Sample<float> sample(float a, float b, float c, float e, float g) const {
            return fibre->sample(a, b, c, e, g);
        }
    };
    struct TableReference {
        const alternatives::Table *table;
        float pdf(float a, float b, float c) const { return table->pdf(a, b, c); }
        cuticle::Sample<float> sample(float a, float b, float c, float e, float g) const {
            return table->sample(a, b, c, e, g);
        }
    };
    add(cases, "d'Eon", f, Reference{&fibre});
    add(cases, "table", f, TableReference{&table});
    for (const Lobes &l : all) {
        const std::string suffix = l.rows > 1 ? ", n=2" : "";
        const float strands = l.rows > 1 ? 2.f : 0.f;
        if (l.lobes == 1) add_fitted<1>(cases, l, f, d, suffix, strands);
        if (l.lobes == 2) add_fitted<2>(cases, l, f, d, suffix, strands);
        if (l.lobes == 4) add_fitted<4>(cases, l, f, d, suffix, strands);
        if (l.lobes == 8) add_fitted<8>(cases, l, f, d, suffix, strands);
        if (l.lobes == 16) add_fitted<16>(cases, l, f, d, suffix, strands);
    }
    timing::time_all(cases, std::atoi(argv[3]), double(inputs));
    // Do the alternatives draw what they say? The mean of a function over samples, to set beside its integral over the
    // density.
    std::printf("{\n");
    const auto mean = [&](const char *name, const auto &sampler) {
        double sum = 0;
        const int count = 2000000;
        std::mt19937 fresh(3);
        std::uniform_real_distribution<float> u(0.f, .99999994f);
        for (int i = 0; i < count; ++i) {
            const auto s = sampler.sample(.4f, u(fresh), u(fresh), u(fresh), u(fresh));
            sum += double(std::exp(-8 * (s.theta_i + .3f) * (s.theta_i + .3f)) * (1 + std::cos(s.phi)));
        }
        std::printf("  \"%s mean\": %.6f,\n", name, sum / count);
    };
    mean("d'Eon", fibre);
    mean("table", table);
    timing::print_medians(cases);
    return 0;
}
