// The lobes over traced arrays, for all plugins that have some: most of what there is to compile.
#include "mixture.h"

namespace cuticle_mitsuba {

template class Mixture<CUTICLE_LLVM>;
CUTICLE_IF_CUDA(template class Mixture<CUTICLE_CUDA>;)

}  // namespace cuticle_mitsuba
