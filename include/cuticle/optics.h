#include "cuticle/scattering/optics.h"  // where it is now
