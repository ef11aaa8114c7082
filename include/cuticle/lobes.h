#include "cuticle/sampler/lobes.h"  // where it is now
