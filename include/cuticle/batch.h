#include "cuticle/sampler/batch.h"  // where it is now
