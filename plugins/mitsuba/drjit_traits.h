// The core through Dr.Jit's arrays: what ArrayTraits asks of them. Include before any header of the core.
#pragma once

#include <drjit/autodiff.h>
#include <drjit/jit.h>
#include <drjit/math.h>
#include <drjit/while_loop.h>

#include "cuticle/math/functions.h"

namespace cuticle {

template <JitBackend Backend, class Value> struct ArrayTraits<drjit::DiffArray<Backend, Value>> {
    using Float = drjit::DiffArray<Backend, Value>;
    using Scalar = Value;
    using Index = drjit::DiffArray<Backend, std::int32_t>;
    static Index to_index(const Float &x) { return Index(x); }
    template <class Memory> static Float gather(const Memory &memory, const Index &index) {
        return drjit::gather<Float>(memory, drjit::uint32_array_t<Float>(index));
    }
    static bool any(const drjit::mask_t<Float> &) { return true; }  // not known while tracing
    // State tells its members, in their order, to apply(use).
    template <class State, class Condition, class Body>
    static void loop(State &state, const Condition &condition, const Body &body) {
        state.apply([&](auto &...member) {
            auto end = drjit::while_loop(
                drjit::make_tuple(member...), [&condition](const auto &...x) { return condition(State{x...}); },
                [&body](auto &...x) {
                    State next{x...};
                    body(next);
                    next.apply([&](auto &...y) { ((x = y), ...); });
                });
            drjit::tie(member...) = end;
        });
    }
};

}  // namespace cuticle
