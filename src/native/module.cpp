#include "bindings.h"

NB_MODULE(_core, m) {
    m.doc() = "The compiled core of cuticle. Its callers validate and shape the arrays; use the package instead.";
    native::bind_densities(m);
    native::bind_fit(m);
    native::bind_groom(m);
    native::bind_models(m);
    native::bind_sampler(m);
}
