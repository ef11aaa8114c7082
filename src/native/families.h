// One of the families of lobes, by the name that Python gives it.
#pragma once

#include "cuticle/sampler/families.h"

#include <stdexcept>
#include <string>

namespace native {

// use(family) for the one of that name.
template <class Use> void with_family(const std::string &name, const Use &use) {
    bool found = false;
    cuticle::each_family([&](const char *known, auto family) {
        if (name != known) return;
        found = true;
        use(family);
    });
    if (!found) throw std::invalid_argument("no family of lobes is called \"" + name + "\"");
}

}  // namespace native
