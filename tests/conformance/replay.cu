// The same on a GPU, a row a thread.
#include "fibre.h"

#include <cstdio>
#include <vector>

__global__ void replay(const float *rows, double *out, int count) {
    const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
    if (i >= count) return;
    REAL x[7];
    for (int k = 0; k < 7; ++k) x[k] = REAL(rows[7 * i + k]);
    const auto s = fibre::sample(x[1], x[4], x[5], x[6], x[3]);
    out[4 * i] = double(fibre::pdf(x[0], x[1], x[2], x[3]));
    out[4 * i + 1] = double(s.theta_i);
    out[4 * i + 2] = double(s.phi);
    out[4 * i + 3] = double(s.pdf);
}

int main(int argc, char **argv) {
    if (argc != 3) return 2;
    std::FILE *in = std::fopen(argv[1], "rb"), *out = std::fopen(argv[2], "wb");
    if (!in || !out) return 3;
    std::vector<float> rows;
    float row[7];
    while (std::fread(row, sizeof row, 1, in) == 1) rows.insert(rows.end(), row, row + 7);
    const int count = static_cast<int>(rows.size() / 7);
    std::vector<double> results(4 * static_cast<std::size_t>(count));
    float *d_rows = nullptr;
    double *d_out = nullptr;
    if (cudaMalloc(&d_rows, rows.size() * sizeof(float)) != cudaSuccess) return 5;
    if (cudaMalloc(&d_out, results.size() * sizeof(double)) != cudaSuccess) return 5;
    cudaMemcpy(d_rows, rows.data(), rows.size() * sizeof(float), cudaMemcpyHostToDevice);
    replay<<<(count + 127) / 128, 128>>>(d_rows, d_out, count);
    if (cudaMemcpy(results.data(), d_out, results.size() * sizeof(double), cudaMemcpyDeviceToHost) != cudaSuccess) return 6;
    std::fwrite(results.data(), sizeof(double), results.size(), out);
    cudaFree(d_rows);
    cudaFree(d_out);
    std::fclose(in);
    return std::fclose(out) == 0 ? 0 : 4;
}
