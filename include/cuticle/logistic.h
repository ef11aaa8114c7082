#include "cuticle/math/logistic.h"  // where it is now
