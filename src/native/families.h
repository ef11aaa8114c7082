// The families of lobes that Python may name; a new one is a line here.
#pragma once

#include <nanobind/nanobind.h>

#include "cuticle/sampler/logistic.h"
#include "cuticle/sampler/normal.h"

#include <stdexcept>
#include <string>

namespace native {

// use(name, family) for each; the first is meant where none is named.
template <class Use> void each_family(const Use &use) {
    use("normal", cuticle::NormalLobes{});
    use("logistic", cuticle::LogisticLobes{});
}

// use(family) for the one of that name.
template <class Use> void with_family(const std::string &name, const Use &use) {
    bool found = false;
    each_family([&](const char *known, auto family) {
        if (name != known) return;
        found = true;
        use(family);
    });
    if (!found) throw std::invalid_argument("no family of lobes is called \"" + name + "\"");
}

}  // namespace native
