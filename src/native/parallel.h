// Loops over arrays on all cores.
#pragma once

#include <algorithm>
#include <cstddef>
#include <thread>
#include <vector>

namespace native {

// body(begin, end) over pieces of [0, count); a piece is never smaller than `least`.
template <class Body> void parallel_for(std::size_t count, std::size_t least, const Body &body) {
    const std::size_t cores = std::max(1u, std::thread::hardware_concurrency());
    const std::size_t pieces = std::max<std::size_t>(1, std::min(cores, count / std::max<std::size_t>(least, 1)));
    const auto bound = [&](std::size_t i) { return count * i / pieces; };
    std::vector<std::thread> others;
    for (std::size_t i = 1; i < pieces; ++i) others.emplace_back([&, i] { body(bound(i), bound(i + 1)); });
    body(0, bound(1));
    for (std::thread &t : others) t.join();
}

// An array of count values, or one value for all of them.
template <class T> struct Broadcast {
    const T *data;
    std::size_t step;
    T operator[](std::size_t i) const { return data[i * step]; }
};

}  // namespace native
