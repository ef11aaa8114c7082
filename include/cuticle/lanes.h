#include "cuticle/simd/lanes.h"  // where it is now
