#include "cuticle/simd/pack.h"  // where it is now
