#include "cuticle/math/erf.h"  // where it is now
