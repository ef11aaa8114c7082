#include "cuticle/scattering/function_table.h"  // where it is now
