// How NumPy arrays arrive: contiguous, of one length or of length 1; results are written to arrays that the caller made.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include "parallel.h"

namespace native {

namespace nb = nanobind;
template <class T> using In = nb::ndarray<const T, nb::c_contig, nb::device::cpu>;
template <class T> using Out = nb::ndarray<T, nb::c_contig, nb::device::cpu>;

template <class T> Broadcast<T> broadcast(const In<T> &a) {
    return {a.data(), a.size() == 1 ? std::size_t(0) : std::size_t(1)};
}

}  // namespace native
