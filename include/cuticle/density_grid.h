#include "cuticle/groom/density_grid.h"  // where it is now
