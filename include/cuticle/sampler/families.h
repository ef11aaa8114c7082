// The families of lobes, by name. A new one is an include and a line here: the build, Python and the tests read the list.
#ifndef CUTICLE_SAMPLER_FAMILIES_H
#define CUTICLE_SAMPLER_FAMILIES_H

#include "cuticle/sampler/logistic.h"
#include "cuticle/sampler/normal.h"

namespace cuticle {

// use(name, family) for each; the first is meant where none is named. A name is that of the family's header.
template <class Use> void each_family(const Use &use) {
    use("normal", NormalLobes{});
    use("logistic", LogisticLobes{});
}

}  // namespace cuticle

#endif  // CUTICLE_SAMPLER_FAMILIES_H
