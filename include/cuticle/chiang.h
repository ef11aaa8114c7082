#include "cuticle/scattering/chiang.h"  // where it is now
