// Loops over arrays on all cores.
#pragma once

#include <algorithm>
#include <cstddef>
#include <exception>
#include <thread>
#include <vector>

namespace native {

// body(begin, end) over pieces of [0, count); a piece is never smaller than `least`. What a piece throws is thrown here,
// once all have ended; pieces for which no thread can be had are done in this one.
template <class Body> void parallel_for(std::size_t count, std::size_t least, const Body &body) {
    const std::size_t cores = std::max(1u, std::thread::hardware_concurrency());
    const std::size_t pieces = std::max<std::size_t>(1, std::min(cores, count / std::max<std::size_t>(least, 1)));
    const auto bound = [&](std::size_t i) { return count * i / pieces; };
    std::vector<std::exception_ptr> thrown(pieces);
    const auto piece = [&](std::size_t i) {
        try {
            body(bound(i), bound(i + 1));
        } catch (...) {
            thrown[i] = std::current_exception();
        }
    };
    std::vector<std::thread> others;
    others.reserve(pieces);
    std::size_t started = 1;
    try {
        for (; started < pieces; ++started) others.emplace_back(piece, started);
    } catch (...) {  // of the system, or of memory
    }
    piece(0);
    for (std::size_t i = started; i < pieces; ++i) piece(i);
    for (std::thread &t : others) t.join();
    for (const std::exception_ptr &e : thrown)
        if (e) std::rethrow_exception(e);
}

// body(i, prepared) for each i < count, with what prepare(i) makes; it is kept while same(i, i - 1).
template <class Same, class Prepare, class Body>
void for_each_prepared(std::size_t count, std::size_t least, const Same &same, const Prepare &prepare, const Body &body) {
    parallel_for(count, least, [&](std::size_t begin, std::size_t end) {
        decltype(prepare(begin)) prepared{};
        for (std::size_t i = begin; i < end; ++i) {
            if (i == begin || !same(i, i - 1)) prepared = prepare(i);
            body(i, prepared);
        }
    });
}

// An array of count values, or one value for all of them.
template <class T> struct Broadcast {
    const T *data;
    std::size_t step;
    T operator[](std::size_t i) const { return data[i * step]; }
};

}  // namespace native
