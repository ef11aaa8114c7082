// The lobes over traced arrays, for all plugins that have some: most of what there is to compile.
#include "mixture.h"

namespace cuticle_mitsuba {

template class Mixture<CUTICLE_LLVM>;
template class Mixture<CUTICLE_CUDA>;

}  // namespace cuticle_mitsuba
