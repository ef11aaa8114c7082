// Densities and samples a second on a GPU, beside a kernel that only draws and writes as many random numbers: see gpu.py.
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
    __device__ float inclination() { return 3.f * next() - 1.5f; }
};

constexpr int rounds = 64;  // what a thread makes
constexpr float strands = 2.f, between = .5f;

// Each makes three numbers of four random ones, with a viewer of its own every time but for OneViewer.
struct Numbers {
    __device__ explicit Numbers(Random &) {}
    __device__ float3 operator()(Random &r) const {
        r.next();
        const float a = r.next(), b = r.next(), c = r.next();
        return make_float3(a, b, c);
    }
};
struct Density {
    __device__ explicit Density(Random &) {}
    __device__ float3 operator()(Random &r) const {
        const float theta_i = r.inclination(), theta_r = r.inclination(), phi = 6.f * r.next() - 3.f, last = r.next();
        return make_float3(theta_i, last, fibre::pdf(theta_i, theta_r, phi, strands));
    }
};
struct Sample {
    float count;
    __device__ explicit Sample(Random &, float count_ = strands) : count(count_) {}
    __device__ float3 operator()(Random &r) const {
        const float theta_r = r.inclination(), u = r.next(), v = r.next(), w = r.next();
        const auto s = fibre::sample(theta_r, u, v, w, count);
        return make_float3(s.theta_i, s.phi, s.pdf);
    }
};
struct Blended : Sample {
    __device__ explicit Blended(Random &r) : Sample(r, between) {}
};
struct OneViewer {
    cuticle::PreparedSampler<float, fibre::lobes> prepared;
    __device__ explicit OneViewer(Random &r) : prepared(fibre::prepare(r.inclination(), strands)) {}
    __device__ float3 operator()(Random &r) const {
        r.next();
        const float u = r.next(), v = r.next(), w = r.next();
        const auto s = prepared.sample(u, v, w);
        return make_float3(s.theta_i, s.phi, s.pdf);
    }
};
// A path's bounce: a direction, f cos and the weight.
struct Bounce {
    __device__ explicit Bounce(Random &) {}
    __device__ float3 operator()(Random &r) const {
        const float theta = r.inclination(), u = r.next(), v = r.next(), w = r.next();
        const float3 viewer = make_float3(sinf(theta), cosf(theta), 0.f);
        float pdf, f[fibre::channels];
        const float3 light = fibre::sample_direction<float3>(viewer, u, v, w, &pdf, strands);
        fibre::eval_direction(viewer, light, f, strands);
        return make_float3(f[0] / pdf, f[fibre::channels / 2] / pdf, f[fibre::channels - 1] / pdf);
    }
};

template <class Make> __global__ void run(float3 *out, int count) {
    const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
    if (i >= count) return;
    Random r{static_cast<unsigned>(i) * 9781u + 1u};
    const Make make(r);
    for (int k = 0; k < rounds; ++k)
        out[static_cast<std::size_t>(k) * static_cast<std::size_t>(count) + static_cast<std::size_t>(i)] = make(r);
}

void check(cudaError_t error) {
    if (error == cudaSuccess) return;
    std::fprintf(stderr, "gpu: %s\n", cudaGetErrorString(error));
    std::exit(2);
}

// The fastest of several launches, and what the kernel takes of a thread.
template <class Make> void report(const char *name, float3 *out, int count) {
    const int block = 128, grid = (count + block - 1) / block;
    cudaEvent_t start, stop;
    check(cudaEventCreate(&start));
    check(cudaEventCreate(&stop));
    float fastest = 1e30f;
    for (int repeat = 0; repeat < 12; ++repeat) {
        check(cudaEventRecord(start));
        run<Make><<<grid, block>>>(out, count);
        check(cudaGetLastError());
        check(cudaEventRecord(stop));
        check(cudaEventSynchronize(stop));
        float milliseconds = 0;
        check(cudaEventElapsedTime(&milliseconds, start, stop));
        if (repeat > 1 && milliseconds < fastest) fastest = milliseconds;
    }
    check(cudaEventDestroy(start));
    check(cudaEventDestroy(stop));
    cudaFuncAttributes kernel;
    check(cudaFuncGetAttributes(&kernel, run<Make>));
    std::printf(", \"%s\": {\"rate\": %.5g, \"registers\": %d, \"local\": %d}", name,
                double(count) * rounds / (1e-3 * double(fastest)), kernel.numRegs, int(kernel.localSizeBytes));
}

}  // namespace

int main() {
    const int count = 1 << 20;
    float3 *out = nullptr;
    check(cudaMalloc(&out, sizeof(float3) * std::size_t(count) * std::size_t(rounds)));
    cudaDeviceProp device;
    check(cudaGetDeviceProperties(&device, 0));
    std::printf("{\"device\": \"%s\"", device.name);
    report<Numbers>("numbers", out, count);
    report<Density>("pdf", out, count);
    report<Sample>("sample", out, count);
    report<Blended>("sample, two rows", out, count);
    report<OneViewer>("sample, one viewer", out, count);
    report<Bounce>("bounce", out, count);
    std::printf("}\n");
    check(cudaFree(out));
    return 0;
}
