// The core through Dr.Jit's arrays: traced ones compile (LLVM and CUDA), packets run and give what each lane alone gives.
#include "drjit_traits.h"

#include <drjit/packet.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>
#include <vector>

#include "cuticle/cuticle.h"

namespace dr = drjit;
using Packet = dr::Packet<float, 8>;

namespace cuticle {

template <> struct ArrayTraits<Packet> {
    using Scalar = float;
    using Index = dr::Packet<std::int32_t, 8>;
    static Index to_index(const Packet &x) { return Index(x); }
    template <class Memory> static Packet gather(const Memory &memory, const Index &index) {
        return dr::gather<Packet>(memory, dr::uint32_array_t<Packet>(index));
    }
    static bool any(const dr::mask_t<Packet> &mask) { return dr::any(mask); }
};

}  // namespace cuticle

// Never called: that they compile is the test.
template <class Float> struct Traced {
    using Table = cuticle::LobeTable<float, 4, Float>;
    using Model = cuticle::DualScatteringModel<float, Float>;
    static Float pdf(const Table &t, const Float &theta_i, const Float &theta_r, const Float &phi, const Float &n) {
        return cuticle::prepare(t, theta_r, n).pdf(theta_i, phi);
    }
    static cuticle::Sample<Float> sample(const Table &t, const Float &theta_r, const Float &n, const Float *u) {
        return cuticle::prepare(t, theta_r, n).sample(u[0], u[1], u[2]);
    }
    static void eval(const Model &m, const Float &theta_i, const Float &theta_r, const Float &phi, const Float &n,
                     Float *f) {
        cuticle::AzimuthalTerms<Float> terms[3];
        cuticle::dual_scattering_terms(m, theta_i, theta_r, cuticle::counted(n), cuticle::mask_all, terms);
        cuticle::dual_scattering_around(m, terms, theta_i, theta_r, phi, cuticle::counted(n), f);
    }
    static void mean(const Model &m, const Float &theta_i, const Float &theta_r, const Float &phi, const Float &n,
                     const Float &behind, Float *f) {
        const cuticle::Surroundings<Float> around{n, behind, true};
        cuticle::AzimuthalTerms<Float> terms[3];
        cuticle::dual_scattering_terms(m, theta_i, theta_r, around, cuticle::mask_all, terms);
        cuticle::dual_scattering_around(m, terms, theta_i, theta_r, phi, around, f);
    }
    static cuticle::Sample<Float> chiang(const cuticle::ChiangFibre<float> &hair, const Float &theta_r, const Float &h,
                                         const float *sigma_a, const float *luminance, const Float *u, Float *f) {
        const auto state = cuticle::chiang_state(hair, theta_r, h, sigma_a, luminance, 3);
        const auto s = cuticle::chiang_sample(hair, state, u[0], u[1], u[2]);
        cuticle::chiang_eval(hair, state, sigma_a, 3, cuticle::mask_all, s.theta_i, s.phi, f);
        return s;
    }
    static Float count(const cuticle::DensityGrid<float, Float> &grid, const Float *origin, const Float *d,
                       const Float &far) {
        return cuticle::count_strands(grid, origin, cuticle::Direction<Float>{d[0], d[1], d[2]}, far);
    }
};

#ifdef TRACED
template struct Traced<dr::DiffArray<JitBackend::LLVM, float>>;
template struct Traced<dr::DiffArray<JitBackend::CUDA, float>>;
#endif

int main() {
    constexpr int lobes = 2, nodes = 4, rows = 3;
    std::mt19937 rng(1);
    const auto uniform = [&](float lo, float hi) { return std::uniform_real_distribution<float>(lo, hi)(rng); };
    std::vector<float> table;
    for (int i = 0; i < rows * nodes; ++i) {
        table.insert(table.end(), {.6f, .4f});
        for (int k = 0; k < lobes; ++k) table.push_back(uniform(-1.5f, 1.5f));
        for (int k = 0; k < lobes; ++k) table.push_back(uniform(0, 3));
        for (int k = 0; k < 2 * lobes; ++k) table.push_back(uniform(.2f, 1));
    }
    const std::vector<float> energy(rows * nodes, 1.f), strands{0, 2, 4};
    const cuticle::LobeTable<float, lobes> view{table.data(), energy.data(), strands.data(), rows, nodes, true};
    float worst = 0;
    int wrong = 0;
    for (int round = 0; round < 1000; ++round) {
        Packet theta_r, theta_i, phi, n, u[3];
        for (std::size_t i = 0; i < 8; ++i) {
            theta_r[i] = uniform(-1.5f, 1.5f);
            theta_i[i] = uniform(-1.5f, 1.5f);
            phi[i] = uniform(-3, 3);
            n[i] = static_cast<float>(rng() % 11) / 2;
            for (Packet &x : u) x[i] = uniform(.01f, .99f);
        }
        const auto sampler = cuticle::prepare(view, theta_r, n);
        const Packet p = sampler.pdf(theta_i, phi);
        const auto drawn = sampler.sample(u[0], u[1], u[2]);
        for (std::size_t i = 0; i < 8; ++i) {
            const auto one = cuticle::prepare(view, float(theta_r[i]), float(n[i]));
            const float expected = one.pdf(theta_i[i], phi[i]);
            const auto s = one.sample(u[0][i], u[1][i], u[2][i]);
            for (const float off : {std::abs(p[i] - expected) / (expected + 1e-3f), std::abs(drawn.theta_i[i] - s.theta_i),
                                    std::abs(drawn.phi[i] - s.phi)}) {
                worst = std::max(worst, off);
                wrong += !(off <= 2e-4f);  // of a NaN, too
            }
        }
    }
    std::printf("packets: worst difference %.2g\n", double(worst));
    return wrong;
}
