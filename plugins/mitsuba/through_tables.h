// The tables of what comes through strands (cuticle/scattering/through_strands.h), in Mitsuba's memory.
#pragma once

#include "drjit_traits.h"

#include <mitsuba/core/properties.h>

#include "cuticle/scattering/through_strands.h"
#include "mixture.h"

namespace cuticle_mitsuba {

template <class Float> struct ThroughTables {
    Buffer<Float> energy, along, azimuth, behind;
    int rows = 0, along_rows = 0, azimuth_rows = 0, columns = 0, channels = 1;
    float limit = 1;

    bool empty() const { return rows == 0; }

    // As Python's ThroughTables; without them it stays empty.
    void read(const mitsuba::Properties &props) {
        if (!props.has_property("through_energy")) return;
        const auto table = [&](const char *name) -> const Tensor<Float> & { return props.get_any<Tensor<Float>>(name); };
        const auto &e = table("through_energy"), &a = table("through_along"), &z = table("through_azimuth");
        rows = int(e.shape(2));
        along_rows = int(a.shape(2));
        azimuth_rows = int(z.shape(2));
        columns = int(z.shape(3));
        channels = int(z.shape(5));
        limit = props.get<float>("through_limit");
        energy = e.array();
        along = a.array();
        azimuth = z.array();
        behind = table("through_behind").array();
    }

    cuticle::ThroughTable<float, Memory<Float>> view() const {
        return {memory<Float>(energy),
                memory<Float>(along),
                memory<Float>(azimuth),
                memory<Float>(behind),
                rows,
                along_rows,
                azimuth_rows,
                columns,
                channels,
                limit};
    }
};

}  // namespace cuticle_mitsuba
