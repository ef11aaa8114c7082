#include "cuticle/math/functions.h"  // where it is now
