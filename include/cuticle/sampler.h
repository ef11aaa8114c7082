#include "cuticle/sampler/sampler.h"  // where it is now
