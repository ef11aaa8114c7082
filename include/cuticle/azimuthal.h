#include "cuticle/scattering/azimuthal.h"  // where it is now
