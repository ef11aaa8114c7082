#include "cuticle/math/config.h"  // where it is now
