// Costs of the far field with parameters as arguments (far_field.h), and of the near field (chiang.h), every viewer with a
// fibre of its own. Prints a name and nanoseconds a direction, medians of interleaved rounds, in single precision.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "cuticle/scattering/far_field.h"
#include "cuticle/simd/lanes.h"

using namespace cuticle;

namespace {

constexpr int count = 4096, rounds = 25, channels = 3;
constexpr float luminance[channels] = {.2126f, .7152f, .0722f};
std::vector<float> numbers[16];
volatile float sink;

enum Input { beta_m, beta_n, alpha, eta, sigma_a, theta_r = sigma_a + channels, theta_i, phi, u, h = u + 3 };

template <class F> F input(int which, int i) {
    if constexpr (std::is_same_v<F, float>) return numbers[which][size_t(i)];
    else return detail::read<F>(numbers[which].data() + i, F::width * F::chunks);
}
template <class F> float first(const F &x) {
    if constexpr (std::is_same_v<F, float>) return x;
    else return x[0];
}

template <class F> FarField<F, channels> prepared(Azimuthal form, int i) {
    FarFibre<F> fibre = chiang_fibre(input<F>(beta_m, i), input<F>(beta_n, i), input<F>(alpha, i), input<F>(eta, i));
    if (form == Azimuthal::normal) fibre.width = F(.4f) * input<F>(beta_n, i);
    F absorption[channels];
    for (int c = 0; c < channels; ++c) absorption[c] = input<F>(sigma_a + c, i);
    return far_field<channels>(form, fibre, input<F>(theta_r, i), absorption, luminance);
}

template <class F, class Body> double nanoseconds(const Body &body) {
    using Clock = std::chrono::steady_clock;
    const int step = std::is_same_v<F, float> ? 1 : CUTICLE_VECTOR_BYTES / 4;
    const auto start = Clock::now();
    float sum = 0;
    for (int i = 0; i < count; i += step) sum += body(i);
    sink = sum;
    return std::chrono::duration<double, std::nano>(Clock::now() - start).count() / count;
}

std::map<std::string, std::vector<double>> found;

template <class F> void measure(const std::string &kind, Azimuthal form) {
    found[kind + " prepare"].push_back(nanoseconds<F>([&](int i) {
        const auto field = prepared<F>(form, i);
        return first(field.height[0][3]) + first(field.edge[50]);
    }));
    found[kind + " sample"].push_back(nanoseconds<F>([&](int i) {
        F f[channels];
        const auto s = far_sample(form, prepared<F>(form, i), input<F>(u, i), input<F>(u + 1, i), input<F>(u + 2, i), f);
        return first(s.pdf) + first(f[0]);
    }));
    const auto field = prepared<F>(form, 0);
    found[kind + " eval"].push_back(nanoseconds<F>([&](int i) {
        F f[channels];
        return first(far_eval(form, field, input<F>(theta_i, i), input<F>(phi, i), f)) + first(f[0]);
    }));
}

void measure_near() {
    const auto state = [](int i, ChiangFibre<float> &fibre, float *absorption) {
        const FarFibre<float> p = chiang_fibre(numbers[beta_m][size_t(i)], numbers[beta_n][size_t(i)],
                                               numbers[alpha][size_t(i)], numbers[eta][size_t(i)]);
        fibre.eta = p.eta;
        fibre.scale = p.width;
        for (int k = 0; k < chiang_lobes; ++k) {
            fibre.variance[k] = p.variance[k];
            fibre.tilt[k] = p.tilt[k];
        }
        for (int c = 0; c < channels; ++c) absorption[c] = numbers[sigma_a + c][size_t(i)];
        return chiang_state(fibre, numbers[theta_r][size_t(i)], numbers[h][size_t(i)], absorption, luminance, channels);
    };
    found["near sample"].push_back(nanoseconds<float>([&](int i) {
        ChiangFibre<float> fibre;
        float absorption[channels], f[channels];
        const auto s = state(i, fibre, absorption);
        const auto drawn =
            chiang_sample(fibre, s, numbers[u][size_t(i)], numbers[u + 1][size_t(i)], numbers[u + 2][size_t(i)]);
        chiang_eval(fibre, s, absorption, channels, mask_all, drawn.theta_i, drawn.phi, f);
        return drawn.pdf + f[0];
    }));
    found["near eval"].push_back(nanoseconds<float>([&](int i) {
        ChiangFibre<float> fibre;
        float absorption[channels], f[channels];
        const auto s = state(i, fibre, absorption);
        const float t = numbers[theta_i][size_t(i)], p = numbers[phi][size_t(i)];
        chiang_eval(fibre, s, absorption, channels, mask_all, t, p, f);
        return chiang_pdf(fibre, s, t, p) + f[0];
    }));
}

}  // namespace

int main() {
    const float ranges[16][2] = {{.05f, 1},  {.05f, 1},     {-.26f, .26f}, {1.3f, 1.8f},  {0, 3},     {0, 3},
                                 {0, 3},     {-1.4f, 1.4f}, {-1.5f, 1.5f}, {-3.1f, 3.1f}, {0, .999f}, {0, .999f},
                                 {0, .999f}, {-.99f, .99f}, {0, 1},        {0, 1}};
    std::mt19937 generator(1);
    for (int k = 0; k < 16; ++k) {
        numbers[k].resize(count + 64);
        for (float &x : numbers[k]) x = std::uniform_real_distribution<float>(ranges[k][0], ranges[k][1])(generator);
    }
    for (int round = 0; round < rounds; ++round) {
        found["calibration"].push_back(nanoseconds<float>([&](int i) {
            float sum = 0;
            for (int j = 0; j < 16; ++j) sum += std::exp(-numbers[u][size_t((i + j) % count)]);
            return sum;
        }));
        measure<float>("one chiang", Azimuthal::logistic);
        measure<float>("one marschner", Azimuthal::normal);
        measure<BatchLanes<float>>("lanes chiang", Azimuthal::logistic);
        measure<BatchLanes<float>>("lanes marschner", Azimuthal::normal);
        measure_near();
    }
    for (auto &[name, times] : found) {
        std::nth_element(times.begin(), times.begin() + rounds / 2, times.end());
        std::printf("%s\t%.4f\n", name.c_str(), times[rounds / 2]);
    }
}
