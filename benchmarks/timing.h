// What the programs that time the core share: their input, and cases in interleaved rounds.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <string>
#include <vector>

namespace timing {

using Clock = std::chrono::steady_clock;

inline double nanoseconds_since(Clock::time_point start) {
    return std::chrono::duration<double, std::nano>(Clock::now() - start).count();
}

[[noreturn]] inline void stop(const char *why, const char *path) {
    std::fprintf(stderr, "%s: %s\n", path, why);
    std::exit(2);
}

// Reads the file that a script wrote; ends the program where it cannot.
struct Reader {
    const char *path;
    std::FILE *file = std::fopen(path, "rb");

    template <class T> std::vector<T> array(std::size_t n) {
        std::vector<T> v(n);
        if (!file) stop("cannot open it", path);
        if (n && std::fread(v.data(), sizeof(T), n, file) != n) stop("it ends early", path);
        return v;
    }
    int integer() { return array<int>(1)[0]; }
    float real() { return array<float>(1)[0]; }
};

struct Case {
    std::string name;
    std::function<double()> pass;  // over all inputs
    std::vector<double> nanoseconds{};
};

// Times a pass of each case in every round.
inline void time_all(std::vector<Case> &cases, int rounds, double inputs) {
    volatile double sink = 0;
    for (int round = 0; round < rounds; ++round)
        for (Case &c : cases) {
#ifdef __AVX__
            // GCC 12 leaves d'Eon's sample with the registers' upper halves in use, which slows libm's erf twentyfold.
            __builtin_ia32_vzeroupper();
#endif
            const auto start = Clock::now();
            sink = sink + c.pass();
            c.nanoseconds.push_back(nanoseconds_since(start) / inputs);
        }
}

// Ends a JSON object with each case's median over the rounds, in nanoseconds an input.
inline void print_medians(std::vector<Case> &cases) {
    for (Case &c : cases) {
        auto &t = c.nanoseconds;
        const auto middle = t.begin() + std::ptrdiff_t(t.size() / 2);
        std::nth_element(t.begin(), middle, t.end());
        std::printf("  \"%s\": %.4f%s\n", c.name.c_str(), *middle, &c == &cases.back() ? "\n}" : ",");
    }
}

}  // namespace timing
