#include "cuticle/scattering/dual_scattering.h"  // where it is now
