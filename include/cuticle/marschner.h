#include "cuticle/scattering/marschner.h"  // where it is now
