// What a call takes.
#pragma once

#include <chrono>
#include <cstddef>

namespace native {

// Time of body(i) for i < count, a call.
template <class Body> double nanoseconds(std::size_t count, const Body &body) {
    using Clock = std::chrono::steady_clock;
    volatile double sink = 0;  // the work must not be optimised away
    const auto start = Clock::now();
    double sum = 0;
    for (std::size_t i = 0; i < count; ++i) sum += static_cast<double>(body(i));
    sink = sum;
    (void)sink;
    return std::chrono::duration<double, std::nano>(Clock::now() - start).count() / static_cast<double>(count);
}

}  // namespace native
