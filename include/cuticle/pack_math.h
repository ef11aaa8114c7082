#include "cuticle/simd/pack_math.h"  // where it is now
