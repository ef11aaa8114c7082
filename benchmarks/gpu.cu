// Samples a second on a GPU, beside a kernel that only draws and writes as many random numbers: see gpu.py.
#include "fibre.h"

#include <cstdio>
#include <cstdlib>

namespace {

// PCG, one stream a thread.
struct Random {
    unsigned state;
    __device__ float next() {
        state = state * 747796405u + 2891336453u;
        const unsigned w = ((state >> ((state >> 28) + 4)) ^ state) * 277803737u;
        return static_cast<float>(((w >> 22) ^ w) >> 8) * (1.f / 16777216.f);
    }
};

constexpr int rounds = 64;  // a thread's samples

__global__ void numbers(float3 *out, int count) {
    const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
    if (i >= count) return;
    Random r{static_cast<unsigned>(i) * 9781u + 1u};
    for (int k = 0; k < rounds; ++k) {
        r.next();  // the viewer's, below
        out[static_cast<std::size_t>(k) * static_cast<std::size_t>(count) + static_cast<std::size_t>(i)] =
            make_float3(r.next(), r.next(), r.next());
    }
}

__global__ void samples(float3 *out, int count, float strands) {
    const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
    if (i >= count) return;
    Random r{static_cast<unsigned>(i) * 9781u + 1u};
    for (int k = 0; k < rounds; ++k) {
        const float theta_r = 3.f * r.next() - 1.5f, u = r.next(), v = r.next(), w = r.next();
        const auto s = fibre::sample(theta_r, u, v, w, strands);
        out[static_cast<std::size_t>(k) * static_cast<std::size_t>(count) + static_cast<std::size_t>(i)] =
            make_float3(s.theta_i, s.phi, s.pdf);
    }
}

// Milliseconds of the fastest of several launches.
template <class Launch> float best(const Launch &launch) {
    cudaEvent_t start, stop;
    cudaEventCreate(&start);
    cudaEventCreate(&stop);
    float fastest = 1e30f;
    for (int repeat = 0; repeat < 12; ++repeat) {
        cudaEventRecord(start);
        launch();
        cudaEventRecord(stop);
        cudaEventSynchronize(stop);
        float milliseconds = 0;
        cudaEventElapsedTime(&milliseconds, start, stop);
        if (repeat > 1 && milliseconds < fastest) fastest = milliseconds;
    }
    return fastest;
}

}  // namespace

int main() {
    const int count = 1 << 20, block = 128, grid = (count + block - 1) / block;
    float3 *out = nullptr;
    if (cudaMalloc(&out, sizeof(float3) * std::size_t(count) * std::size_t(rounds)) != cudaSuccess) {
        std::fprintf(stderr, "gpu: no device, or not enough memory on it\n");
        return 2;
    }
    const double total = double(count) * rounds;
    const float plain = best([&] { numbers<<<grid, block>>>(out, count); });
    const float row = best([&] { samples<<<grid, block>>>(out, count, 2.f); });
    const float blend = best([&] { samples<<<grid, block>>>(out, count, .5f); });
    if (cudaGetLastError() != cudaSuccess) return 3;
    cudaDeviceProp device;
    cudaGetDeviceProperties(&device, 0);
    std::printf("{\"device\": \"%s\", \"numbers\": %.4g, \"samples\": %.4g, \"samples, two rows\": %.4g}\n", device.name,
                total / (1e-3 * double(plain)), total / (1e-3 * double(row)), total / (1e-3 * double(blend)));
    cudaFree(out);
    return 0;
}
