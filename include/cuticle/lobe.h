#include "cuticle/sampler/normal.h"  // where it is now
