// How often hair is lit by a direction toward an emitter, and how often by one that its BSDF draws.
#pragma once

#include <array>
#include <cstddef>

namespace cuticle_mitsuba {

struct TechniqueChances {
    float emitter = 1, bsdf = 1;
};

// One technique is always used; the other always, or now and then: never not at all, which keeps weights bounded. What they
// find is weighed by chance times density (the balance heuristic of Veach and Guibas 1995), and is the same on average for
// all of these.
class TechniqueChoice {
  public:
    static constexpr std::array<TechniqueChances, 5> choices{{{1, 1}, {1, .3f}, {1, .1f}, {.3f, 1}, {.1f, 1}}};

    // Of each choice, the expected square of a sample's light, summed over some samples.
    std::array<double, choices.size()> squares{};

    TechniqueChoice &operator+=(const TechniqueChoice &other) {
        for (size_t k = 0; k < choices.size(); ++k) squares[k] += other.squares[k];
        return *this;
    }

    // The choice of the least noise at equal time, of which two directions and finding the hair take a half each; where all
    // lanes wait for one (`abreast`), at equal samples.
    TechniqueChances best(bool abreast) const {
        size_t found = 0;
        const auto loss = [&](size_t k) { return squares[k] * (abreast ? 1 : 2 + choices[k].emitter + choices[k].bsdf); };
        for (size_t k = 1; k < choices.size(); ++k)
            if (loss(k) < loss(found)) found = k;
        return choices[found];
    }
};

}  // namespace cuticle_mitsuba
