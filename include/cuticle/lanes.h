#include "cuticle/sampler/lanes.h"  // where it is now
