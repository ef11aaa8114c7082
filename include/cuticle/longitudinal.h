#include "cuticle/scattering/longitudinal.h"  // where it is now
