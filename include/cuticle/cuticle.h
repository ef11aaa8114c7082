// The whole core.
#pragma once

#include "cuticle/angles.h"
#include "cuticle/azimuthal.h"
#include "cuticle/density_grid.h"
#include "cuticle/dual_scattering.h"
#include "cuticle/lobe.h"
#include "cuticle/lobes.h"
#include "cuticle/longitudinal.h"
#include "cuticle/marschner.h"
#include "cuticle/math.h"
#include "cuticle/multiple_scattering.h"
#include "cuticle/optics.h"
#include "cuticle/sampler.h"
