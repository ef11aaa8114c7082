#include "cuticle/math/angles.h"  // where it is now
