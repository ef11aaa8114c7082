// The same on a GPU, a row a thread.
#include "fibre.h"

#include <cstdio>
#include <vector>

#ifdef EVAL
#ifdef AROUND
constexpr int inputs = 6, outputs = fibre::channels;
#else
constexpr int inputs = 4, outputs = fibre::channels;
#endif
__device__ void answer(const REAL *x, double *out) {
    REAL f[outputs];
#ifdef AROUND
    fibre::eval_around(x[0], x[1], x[2], f, x[3], x[4], x[5] > 0);
#else
    fibre::eval(x[0], x[1], x[2], f, x[3]);
#endif
    for (int c = 0; c < outputs; ++c) out[c] = double(f[c]);
}
#else
constexpr int inputs = 7, outputs = 4;
__device__ void answer(const REAL *x, double *out) {
    const auto s = fibre::sample(x[1], x[4], x[5], x[6], x[3]);
    out[0] = double(fibre::pdf(x[0], x[1], x[2], x[3]));
    out[1] = double(s.theta_i);
    out[2] = double(s.phi);
    out[3] = double(s.pdf);
}
#endif

__global__ void replay(const float *rows, double *out, int count) {
    const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
    if (i >= count) return;
    REAL x[inputs];
    for (int k = 0; k < inputs; ++k) x[k] = REAL(rows[inputs * i + k]);
    answer(x, out + outputs * i);
}

int main(int argc, char **argv) {
    if (argc != 3) return 2;
    std::FILE *in = std::fopen(argv[1], "rb"), *out = std::fopen(argv[2], "wb");
    if (!in || !out) return 3;
    std::vector<float> rows;
    float row[inputs];
    while (std::fread(row, sizeof row, 1, in) == 1) rows.insert(rows.end(), row, row + inputs);
    const int count = static_cast<int>(rows.size() / inputs);
    std::vector<double> results(outputs * static_cast<std::size_t>(count));
    float *d_rows = nullptr;
    double *d_out = nullptr;
    if (cudaMalloc(&d_rows, rows.size() * sizeof(float)) != cudaSuccess) return 5;
    if (cudaMalloc(&d_out, results.size() * sizeof(double)) != cudaSuccess) return 5;
    cudaMemset(d_out, 0xff, results.size() * sizeof(double));  // a row that no thread answers is no number
    cudaMemcpy(d_rows, rows.data(), rows.size() * sizeof(float), cudaMemcpyHostToDevice);
    replay<<<(count + 127) / 128, 128>>>(d_rows, d_out, count);
    if (cudaGetLastError() != cudaSuccess) return 6;
    if (cudaMemcpy(results.data(), d_out, results.size() * sizeof(double), cudaMemcpyDeviceToHost) != cudaSuccess) return 6;
    std::fwrite(results.data(), sizeof(double), results.size(), out);
    cudaFree(d_rows);
    cudaFree(d_out);
    std::fclose(in);
    return std::fclose(out) == 0 ? 0 : 4;
}
