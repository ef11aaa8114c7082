// Cost of the core in single precision on one thread, as multiples of a calibration kernel (16 independent
// expf calls on varying inputs) timed in the same rounds. bench.py writes the input, compiles and runs this, for one family
// of lobes.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "cuticle/cuticle.h"
#include "timing.h"

#ifndef BENCH_FAMILY
#define BENCH_FAMILY NormalLobes
#endif

namespace {

template <int K> using Lobes = cuticle::LobeTable<float, K, const float *, cuticle::BENCH_FAMILY>;
constexpr int inputs = 4096;
constexpr std::size_t bulk = 10'000'000;

struct Inputs {
    std::vector<float> theta_i, theta_r, phi, u0, u1, u2;
};

std::vector<float> uniform(std::mt19937 &rng, float lo, float hi) {
    std::uniform_real_distribution<float> d(lo, hi);
    std::vector<float> v(inputs);
    for (float &x : v) x = d(rng);
    return v;
}

struct TableData {
    int lobes, rows, theta_nodes;
    bool even;
    std::vector<float> nodes, energy, strands;
};

template <int K>
void add_sampler(std::vector<timing::Case> &cases, const std::string &label, const TableData &data, const Inputs &in,
                 float strands) {
    const Lobes<K> table{data.nodes.data(), data.energy.data(), data.strands.data(), data.rows, data.theta_nodes, data.even};
    cases.push_back({label + " pdf", [=, &in] {
                         float sum = 0;
                         for (int i = 0; i < inputs; ++i)
                             sum += cuticle::pdf(table, in.theta_i[i], in.theta_r[i], in.phi[i], strands);
                         return sum;
                     }});
    cases.push_back({label + " sample", [=, &in] {
                         float sum = 0;
                         for (int i = 0; i < inputs; ++i) {
                             const auto s = cuticle::sample(table, in.theta_r[i], in.u0[i], in.u1[i], in.u2[i], strands);
                             sum += s.theta_i + s.phi + s.pdf;
                         }
                         return sum;
                     }});
    const auto once = cuticle::prepare(table, .5f, strands);
    cases.push_back({label + " pdf, prepared", [=, &in] {
                         float sum = 0;
                         for (int i = 0; i < inputs; ++i) sum += once.pdf(in.theta_i[i], in.phi[i]);
                         return sum;
                     }});
}

void add_table(std::vector<timing::Case> &cases, const std::string &label, const TableData &data, const Inputs &in,
               float strands) {
    switch (data.lobes) {
        case 1:
            return add_sampler<1>(cases, label, data, in, strands);
        case 2:
            return add_sampler<2>(cases, label, data, in, strands);
        case 4:
            return add_sampler<4>(cases, label, data, in, strands);
        case 8:
            return add_sampler<8>(cases, label, data, in, strands);
        case 16:
            return add_sampler<16>(cases, label, data, in, strands);
        default:
            std::fprintf(stderr, "bench: no case for %d lobes\n", data.lobes);
            std::exit(2);
    }
}

}  // namespace

int main(int argc, char **argv) {
    if (argc != 3) {
        std::fprintf(stderr, "usage: bench INPUT ROUNDS\n");
        return 2;
    }
    timing::Reader reader{argv[1]};
    std::mt19937 rng(7);
    const Inputs in{uniform(rng, -1.5f, 1.5f), uniform(rng, -1.5f, 1.5f), uniform(rng, -3.14f, 3.14f),
                    uniform(rng, 0, 1),        uniform(rng, 0, 1),        uniform(rng, 0, 1)};
    std::vector<timing::Case> cases;
    cases.push_back({"calibration", [&in] {
                         float sum = 0;
                         for (int i = 0; i < inputs; ++i)
                             for (int k = 0; k < 16; ++k) sum += std::exp(in.theta_i[(i + k) & (inputs - 1)] - in.u0[i]);
                         return sum;
                     }});
    cases.push_back({"uniform sphere sample", [&in] {
                         float sum = 0;
                         for (int i = 0; i < inputs; ++i)
                             sum += std::asin(2 * in.u1[i] - 1) + cuticle::pi<float> * (2 * in.u2[i] - 1) + .0795774715f;
                         return sum;
                     }});

    std::vector<TableData> tables(static_cast<std::size_t>(reader.integer()));
    for (TableData &t : tables) {
        t.lobes = reader.integer();
        t.rows = reader.integer();
        t.theta_nodes = reader.integer();
        t.even = reader.integer() != 0;
        const auto cells = static_cast<std::size_t>(t.rows * t.theta_nodes);
        t.nodes = reader.array<float>(cells * static_cast<std::size_t>(cuticle::lobe_parameters * t.lobes));
        t.energy = reader.array<float>(cells);
        t.strands = reader.array<float>(static_cast<std::size_t>(t.rows));
        const float strands = reader.real();
        const int length = reader.integer();
        const auto label = reader.array<char>(static_cast<std::size_t>(length));
        add_table(cases, std::string(label.begin(), label.end()), t, in, strands);
    }

    const int rows = reader.integer(), columns = reader.integer(), channels = reader.integer();
    const int through_rows = reader.integer(), along_rows = reader.integer(), azimuth_rows = reader.integer(),
              turns = reader.integer();
    const auto count = [](int n) { return static_cast<std::size_t>(n); };
    const int parts = 2 * cuticle::strand_nodes * cuticle::through_parts * channels;
    const auto direct = reader.array<float>(count(rows * columns * channels * cuticle::lobe_count));
    const auto energy = reader.array<float>(count(cuticle::energy_columns * parts * through_rows));
    const auto along = reader.array<float>(count(cuticle::along_columns * parts * along_rows));
    const auto azimuth = reader.array<float>(count(parts * azimuth_rows * turns));
    const auto behind = reader.array<float>(count(3 * channels * through_rows));
    cuticle::DualScatteringModel<float> model{};
    for (float &x : model.fibre.alpha) x = reader.real();
    for (float &x : model.fibre.beta) x = reader.real();
    model.formulation = cuticle::Formulation::exact;
    model.fibre.form = cuticle::longitudinal_of(model.formulation);
    model.direct = {direct.data(), rows, columns, channels};
    const float limit = reader.real();
    model.through = {energy.data(), along.data(), azimuth.data(), behind.data(), through_rows,
                     along_rows,    azimuth_rows, turns,          channels,      limit};
    model.d_f = reader.real();
    model.d_b = reader.real();
    for (const float strands : {0.f, 2.f})
        cases.push_back({"eval, " + std::string(strands > 0 ? "2 strands" : "direct"), [&in, &model, strands] {
                             float sum = 0, f[32];
                             cuticle::AzimuthalTerms<float> terms[32];
                             const auto around = cuticle::counted(strands);
                             for (int i = 0; i < inputs; ++i) {
                                 cuticle::dual_scattering_terms(model, in.theta_i[i], in.theta_r[i], around, 15, terms);
                                 cuticle::dual_scattering_around(model, terms, in.theta_i[i], in.theta_r[i], in.phi[i],
                                                                 around, f);
                                 sum += f[0];
                             }
                             return sum;
                         }});

    // What all cores' plain loops give from arrays to arrays: the measure for the Python call (single precision, K = 4).
    const TableData *four = nullptr;
    for (const TableData &t : tables)
        if (t.lobes == 4 && !four) four = &t;
    std::vector<float> viewers, random, result;
    if (four) {
        viewers.resize(bulk);
        random.resize(3 * bulk);
        result.resize(3 * bulk);
        std::uniform_real_distribution<float> d(0, 1);
        for (std::size_t i = 0; i < bulk; ++i) viewers[i] = in.theta_r[i % inputs];
        for (float &x : random) x = std::min(d(rng), .99999994f);
    }
    const auto all_cores = [&] {
        const Lobes<4> table{four->nodes.data(), four->energy.data(), four->strands.data(),
                             four->rows,         four->theta_nodes,   four->even};
        const auto work = [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i < end; ++i) {
                const auto s = cuticle::sample(table, viewers[i], random[3 * i], random[3 * i + 1], random[3 * i + 2], 2.f);
                result[i] = s.theta_i;
                result[bulk + i] = s.phi;
                result[2 * bulk + i] = s.pdf;
            }
        };
        const std::size_t cores = std::max(1u, std::thread::hardware_concurrency());
        std::vector<std::thread> threads;
        for (std::size_t c = 0; c < cores; ++c) threads.emplace_back(work, bulk * c / cores, bulk * (c + 1) / cores);
        for (std::thread &t : threads) t.join();
    };

    timing::time_all(cases, std::atoi(argv[2]), inputs);
    double best = 1e30;
    for (int repeat = 0; four && repeat < 5; ++repeat) {
        const auto start = timing::Clock::now();
        all_cores();
        best = std::min(best, timing::nanoseconds_since(start) / double(bulk));
    }
    std::printf("{\n  \"all cores, sample\": %.4f,\n", four ? best : 0.);
    timing::print_medians(cases);
    return 0;
}
