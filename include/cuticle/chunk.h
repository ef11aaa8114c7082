#include "cuticle/simd/chunk.h"  // where it is now
