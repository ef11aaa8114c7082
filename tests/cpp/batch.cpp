// The sampler over arrays gives what it gives one by one: every number of lobes, counts on, between and beyond rows, a
// ragged end, and nothing written past it.
#include "cuticle/cuticle.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>
#include <vector>

namespace {

// A function of its own: at every call inlined anew, it would be most of what is compiled.
template <class Float, int K>
[[gnu::noinline]] Float pdf(const cuticle::LobeTable<Float, K> &view, Float theta_i, Float theta_r, Float phi,
                            Float strands) {
    return cuticle::pdf(view, theta_i, theta_r, phi, strands);
}
template <class Float, int K>
[[gnu::noinline]] Float pdf(const cuticle::PreparedSampler<Float, K> &prepared, Float theta_i, Float phi) {
    return prepared.pdf(theta_i, phi);
}

// `plain` strands for all of them, or a number each where it is negative. Nodes are wild or, 25 of them, go slowly, as
// fitted ones do.
template <class Float, int K> int compare(bool even, double plain, int nodes, std::size_t count, std::mt19937 &rng) {
    const bool each = plain < 0;
    const std::vector<Float> strands{0, 1, 4};
    const auto uniform = [&](double lo, double hi) { return Float(std::uniform_real_distribution<double>(lo, hi)(rng)); };
    std::vector<Float> table, energy;
    const bool slow = nodes == 25;
    for (std::size_t i = 0; i < strands.size() * std::size_t(nodes); ++i) {
        const auto value = [&](int k, double lo, double hi) {
            if (!slow) return uniform(lo, hi);
            return Float(lo + (hi - lo) * (.5 + .5 * std::sin(k + .1 * double(i % std::size_t(nodes)) + double(i / 25))));
        };
        Float parameter[5][K], total = 0;
        for (int k = 0; k < K; ++k) {
            total += parameter[0][k] = value(5 * k, .1, 1);
            parameter[1][k] = value(5 * k + 1, -1.6, 1.6);
            parameter[2][k] = even ? value(5 * k + 2, -.1, 3.2) : value(5 * k + 2, -6, 6);
            parameter[3][k] = value(5 * k + 3, .15, 1);
            parameter[4][k] = value(5 * k + 4, .15, 2);
        }
        for (int k = 0; k < K; ++k) parameter[0][k] /= total;
        for (auto &row : parameter) table.insert(table.end(), row, row + K);
        energy.push_back(uniform(.1, 1));
    }
    const cuticle::LobeTable<Float, K> view{table.data(), energy.data(), strands.data(), 3, nodes, even};

    std::vector<Float> ti(count), tr(count), ph(count), n(count), u(count), v(count), w(count);
    std::vector<Float> p(count + 1, Float(-7)), a(p), b(p), q(p);
    for (std::size_t i = 0; i < count; ++i) {
        ti[i] = uniform(-1.57, 1.57);
        tr[i] = uniform(-1.57, 1.57);
        ph[i] = uniform(-6, 6);
        n[i] = each ? (i / 64 % 2 ? uniform(0, 6) : Float(i / 128 % 5)) : Float(plain);
        u[i] = uniform(0, 1);
        v[i] = uniform(.001, .999);
        w[i] = uniform(.001, .999);
    }
    cuticle::pdf_batch(view, count, ti.data(), tr.data(), ph.data(), n.data(), each, p.data());
    cuticle::sample_batch(view, count, tr.data(), u.data(), v.data(), w.data(), n.data(), each, a.data(), b.data(),
                          q.data());
    // Rounding of theta_r grows with the number of nodes it is told in, and moves an exponent by how fast they go. Densities
    // below 1e-12 are compared absolutely, as hosts are: one lobe alone leaves directions to tails where nothing is drawn.
    const Float relative = Float(slow ? 2 : nodes) * (std::is_same_v<Float, float> ? Float(2e-5) : Float(1e-10)),
                radians = relative, least = Float(1e-12);
    const auto off = [&](Float x, Float right) { return !(std::abs(x - right) <= relative * std::max(right, least)); };
    int wrong = 0, other = 0;
    for (std::size_t i = 0; i < count; ++i) {
        const Float single = pdf(view, ti[i], tr[i], ph[i], n[i]);
        wrong += off(p[i], single);
        const auto s = cuticle::sample(view, tr[i], u[i], v[i], w[i], n[i]);
        const bool same =
            std::abs(a[i] - s.theta_i) <= radians && std::abs(cuticle::math::nearest_turn(Float(b[i] - s.phi))) <= radians;
        other += !same;  // a u on the border between two lobes may choose either
        wrong += off(q[i], pdf(view, a[i], tr[i], b[i], n[i]));
    }
    wrong += other > 2;
    // One shading point, on a row, between rows and between none and some.
    for (const Float strands : {Float(1), Float(2.5), Float(.3)}) {
        const auto prepared = cuticle::prepare(view, tr[0], strands);
        cuticle::pdf_batch(prepared, count, ti.data(), ph.data(), p.data());
        cuticle::sample_batch(prepared, count, u.data(), v.data(), w.data(), a.data(), b.data(), q.data());
        int strayed = 0;
        for (std::size_t i = 0; i < count; ++i) {
            const Float single = pdf(prepared, ti[i], ph[i]);
            wrong += off(p[i], single);
            const auto s = prepared.sample(u[i], v[i], w[i]);
            strayed += !(std::abs(a[i] - s.theta_i) <= radians &&
                         std::abs(cuticle::math::nearest_turn(Float(b[i] - s.phi))) <= radians);
            wrong += off(q[i], pdf(prepared, a[i], b[i]));
        }
        wrong += strayed > 2;
    }
    for (const auto &out : {p, a, b, q}) wrong += out[count] != Float(-7);
    if (wrong)
        std::printf("%d lobes, even %d, strands %g, %d nodes, %zu directions, %zu bytes: %d wrong, %d other\n", K, even,
                    plain, nodes, count, sizeof(Float), wrong, other);
    return wrong;
}

template <class Float, int K> int cases(bool even, std::mt19937 &rng) {
    return compare<Float, K>(even, -1, 9, 1003, rng) + compare<Float, K>(even, 4, 9, 1091, rng) +
           compare<Float, K>(even, 2.5, 25, 1500, rng) + compare<Float, K>(even, 0, 32, 300, rng) +
           compare<Float, K>(even, .4, 2, 1024, rng) + compare<Float, K>(even, 1, 17, 5, rng);
}
template <class Float, int... K> int all() {
    std::mt19937 rng(3);
    int wrong = 0;
    for (const bool even : {true, false}) wrong += (cases<Float, K>(even, rng) + ...);
    return wrong;
}

}  // namespace

int main() {
#ifdef WHOLE  // double is a plain loop
    return all<float, 1, 2, 4, 8>() + all<double, 4>() == 0 ? 0 : 1;
#else
    return all<float, 4>() == 0 ? 0 : 1;
#endif
}
