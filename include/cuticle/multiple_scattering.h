#include "cuticle/scattering/multiple_scattering.h"  // where it is now
