// What replays of exported files share: rows of `inputs` numbers in single precision are read, of each `outputs` numbers in
// double are written, as `answer` has them; by nvcc on a GPU, a row a thread. The program defines the three before.
#include <cstdio>
#include <vector>

CUTICLE_HD inline void answer_row(const float *row, double *out) {
    REAL x[inputs];
    for (int k = 0; k < inputs; ++k) x[k] = REAL(row[k]);
    answer(x, out);
}

#ifdef __CUDACC__
__global__ void replay(const float *rows, double *out, int count) {
    const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
    if (i < count) answer_row(rows + inputs * i, out + outputs * i);
}
int answer_all(const std::vector<float> &rows, std::vector<double> &results, int count) {
    float *d_rows = nullptr;
    double *d_out = nullptr;
    if (cudaMalloc(&d_rows, rows.size() * sizeof(float)) != cudaSuccess) return 5;
    if (cudaMalloc(&d_out, results.size() * sizeof(double)) != cudaSuccess) return 5;
    cudaMemset(d_out, 0xff, results.size() * sizeof(double));  // a row that no thread answers is no number
    cudaMemcpy(d_rows, rows.data(), rows.size() * sizeof(float), cudaMemcpyHostToDevice);
    replay<<<(count + 127) / 128, 128>>>(d_rows, d_out, count);
    if (cudaGetLastError() != cudaSuccess) return 6;
    if (cudaMemcpy(results.data(), d_out, results.size() * sizeof(double), cudaMemcpyDeviceToHost) != cudaSuccess) return 6;
    cudaFree(d_rows);
    cudaFree(d_out);
    return 0;
}
#else
int answer_all(const std::vector<float> &rows, std::vector<double> &results, int count) {
    for (int i = 0; i < count; ++i) answer_row(rows.data() + inputs * i, results.data() + outputs * i);
    return 0;
}
#endif

int main(int argc, char **argv) {
    if (argc != 3) return 2;
    std::FILE *in = std::fopen(argv[1], "rb"), *out = std::fopen(argv[2], "wb");
    if (!in || !out) return 3;
    std::vector<float> rows;
    float row[inputs];
    while (std::fread(row, sizeof row, 1, in) == 1) rows.insert(rows.end(), row, row + inputs);
    const int count = static_cast<int>(rows.size() / inputs);
    std::vector<double> results(outputs * static_cast<std::size_t>(count));
    const int failed = answer_all(rows, results, count);
    if (failed) return failed;
    std::fwrite(results.data(), sizeof(double), results.size(), out);
    std::fclose(in);
    return std::fclose(out) == 0 ? 0 : 4;
}
