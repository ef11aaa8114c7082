// Locates a number of strands among the counts of a table's rows.
#ifndef CUTICLE_SAMPLER_STRAND_COUNTS_H
#define CUTICLE_SAMPLER_STRAND_COUNTS_H

#include "cuticle/math/functions.h"

namespace cuticle {

// The two neighbouring counts around a number of strands; the first or the last two for numbers beyond.
template <class Float> struct CountInterval {
    typename ArrayTraits<Float>::Index row;
    Float low, high;
};

template <class Float, class Scalar>
CUTICLE_INLINE CountInterval<Float> locate_count(const Scalar *counts, int rows, const Float &strands) {
    using Traits = ArrayTraits<Float>;
    using Index = typename Traits::Index;
    const bool several = rows > 1;
    Index row = Index(0);
    Float low = Float(counts[0]), high = several ? Float(counts[1]) : Float(low + Float(1));
    if constexpr (std::is_arithmetic_v<Float>) {  // branches, so that loads need not wait
        while (row + 2 < rows && strands >= Float(counts[row + 1])) ++row;
        low = Float(counts[row]);
        if (several) high = Float(counts[row + 1]);
    } else {
        for (int k = 1; k + 1 < rows; ++k) {
            const Float count = Float(counts[k]);
            const auto past = strands >= count;
            if (!Traits::any(past)) break;
            row = select(past, Index(k), row);
            low = select(past, count, low);
            high = select(past, Float(counts[k + 1]), high);
        }
    }
    return {row, low, high};
}

}  // namespace cuticle

#endif  // CUTICLE_SAMPLER_STRAND_COUNTS_H
