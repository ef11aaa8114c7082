// The whole core.
#ifndef CUTICLE_CUTICLE_H
#define CUTICLE_CUTICLE_H

#include "cuticle/angles.h"
#include "cuticle/azimuthal.h"
#include "cuticle/batch.h"
#include "cuticle/chiang.h"
#include "cuticle/density_grid.h"
#include "cuticle/dual_scattering.h"
#include "cuticle/erf.h"
#include "cuticle/lanes.h"
#include "cuticle/lobe.h"
#include "cuticle/lobes.h"
#include "cuticle/logistic.h"
#include "cuticle/longitudinal.h"
#include "cuticle/marschner.h"
#include "cuticle/math.h"
#include "cuticle/multiple_scattering.h"
#include "cuticle/optics.h"
#include "cuticle/row.h"
#include "cuticle/sampler.h"
#include "cuticle/tabulated.h"

#endif  // CUTICLE_CUTICLE_H
