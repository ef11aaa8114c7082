// The tables of what comes through strands, as Python makes them (fibre_tables.py).
#pragma once

#include "arrays.h"
#include "cuticle/scattering/through_strands.h"

namespace native {

template <class T>
cuticle::ThroughTable<T> through_view(const In<T> &energy, const In<T> &along, const In<T> &azimuth, const In<T> &behind,
                                      T limit) {
    const auto size = [](const In<T> &a, std::size_t axis) { return static_cast<int>(a.shape(axis)); };
    return {energy.data(),  along.data(),     azimuth.data(),   behind.data(),    size(energy, 2),
            size(along, 2), size(azimuth, 2), size(azimuth, 3), size(azimuth, 5), limit};
}

}  // namespace native
