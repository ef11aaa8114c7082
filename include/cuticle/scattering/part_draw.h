// Draws a direction from a few parts, each the energy-conserving M times a density of azimuth that is linear between nodes.
#ifndef CUTICLE_SCATTERING_PART_DRAW_H
#define CUTICLE_SCATTERING_PART_DRAW_H

#include "cuticle/sampler/sample.h"
#include "cuticle/scattering/longitudinal.h"

namespace cuticle {

// The part that a number in [0, 1) chooses among some whose shares sum to 1; they are passed in their order.
template <class Float> struct ChosenPart {
    Float below;          // the shares of those passed
    Float start, chance;  // where the chosen one's share begins, and what it is
    Float part, channel, axis, variance;
};
template <class Float> CUTICLE_INLINE ChosenPart<Float> none_chosen(const Float &below) {
    return {below, Float(0), below, Float(0), Float(0), Float(0), Float(1)};
}
template <class Float>
CUTICLE_INLINE ChosenPart<Float> pass_part(const ChosenPart<Float> &by, const Float &u, const Float &share, int part,
                                           int channel, const Float &axis, const Float &variance) {
    const auto past = (u >= by.below) & (share > Float(0));
    return {by.below + share,
            select(past, by.below, by.start),
            select(past, share, by.chance),
            select(past, Float(part), by.part),
            select(past, Float(channel), by.channel),
            select(past, axis, by.axis),
            select(past, variance, by.variance)};
}
// What the choice leaves of the number, again in [0, 1).
template <class Float> CUTICLE_INLINE Float left_of(const ChosenPart<Float> &chosen, const Float &u) {
    return math::clamp(Float((u - chosen.start) / math::max(chosen.chance, Float(smallest<Float>))), Float(0),
                       Float(1 - .5 * epsilon<Float>));
}

// Where between two nodes a density that is linear there has what is wanted of its integral, in half steps.
template <class Float> CUTICLE_HD Float linear_quantile(const Float &from, const Float &to, const Float &wanted) {
    const Float root = math::sqrt(math::max(Float(from * from + (to - from) * wanted), Float(0)));
    return math::clamp(Float(wanted / math::max(Float(from + root), Float(smallest<Float>))), Float(0), Float(1));
}

// An azimuth in [0, pi] by a density that is linear between node_count(of) nodes, at which node_density(of, node) returns
// it.
template <class Float, class Densities> CUTICLE_HD Float draw_azimuth(const Densities &of, const Float &u) {
    const int nodes = node_count(of);
    const Float first = node_density(of, 0);
    Float last = first, total = Float(0);
    for (int j = 1; j < nodes; ++j) {
        const Float here = node_density(of, j);
        total = total + last + here;
        last = here;
    }
    const Float wanted = u * total;
    Float low = first, high = node_density(of, 1), passed = Float(0), node = Float(0), below = Float(0);
    Float from = low, to = high;
    for (int j = 1; j < nodes - 1; ++j) {
        below = below + low + high;
        low = high;
        high = node_density(of, j + 1);
        const auto past = wanted >= below;
        from = select(past, low, from);
        to = select(past, high, to);
        passed = select(past, below, passed);
        node = select(past, Float(j), node);
    }
    return (node + linear_quantile(from, to, Float(wanted - passed))) * (Float(pi<double>) / Float(nodes - 1));
}

// A direction from what is left, which turns it about the axis of M, and two numbers more: the last chooses the side and the
// azimuth.
template <class Float, class Densities>
CUTICLE_HD Angles<Float> draw_part(const ChosenPart<Float> &chosen, const Densities &azimuths, const Float &left,
                                   const Float &u_theta, const Float &u_phi) {
    const Float side = Float(2) * u_phi, turn = draw_azimuth(azimuths, Float(side - math::floor(side)));
    return {about_axis(chosen.axis, chosen.variance, u_theta, Float(Float(2 * pi<double>) * left)),
            select(side < Float(1), turn, Float(-turn))};
}

}  // namespace cuticle

#endif  // CUTICLE_SCATTERING_PART_DRAW_H
