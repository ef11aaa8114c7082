// The whole core. A folder includes those above it in this list, never those below:
//   math        functions of a number or of an array type, angles
//   simd        packs: numbers side by side in the compiler's vectors
//   sampler     the densities of lobes, their mixture, the table they run through, arrays of directions
//   scattering  what fibres do to light
//   groom       strands in space
#ifndef CUTICLE_CUTICLE_H
#define CUTICLE_CUTICLE_H

#include "cuticle/math/angles.h"
#include "cuticle/math/erf.h"
#include "cuticle/math/functions.h"
#include "cuticle/math/logistic.h"
#include "cuticle/math/table_values.h"

#include "cuticle/simd/abreast.h"
#include "cuticle/simd/lanes.h"
#include "cuticle/simd/pack.h"
#include "cuticle/simd/pack_math.h"
#include "cuticle/simd/several.h"

#include "cuticle/sampler/batch.h"
#include "cuticle/sampler/families.h"
#include "cuticle/sampler/lobe_table.h"
#include "cuticle/sampler/lobes.h"
#include "cuticle/sampler/sampler.h"

#include "cuticle/scattering/azimuthal.h"
#include "cuticle/scattering/chiang.h"
#include "cuticle/scattering/dual_scattering.h"
#include "cuticle/scattering/far_among.h"
#include "cuticle/scattering/far_cells.h"
#include "cuticle/scattering/far_fibre.h"
#include "cuticle/scattering/far_field.h"
#include "cuticle/scattering/function_table.h"
#include "cuticle/scattering/longitudinal.h"
#include "cuticle/scattering/marschner.h"
#include "cuticle/scattering/multiple_scattering.h"
#include "cuticle/scattering/optics.h"
#include "cuticle/scattering/part_draw.h"
#include "cuticle/scattering/through_draw.h"
#include "cuticle/scattering/through_strands.h"
#include "cuticle/scattering/through_table.h"

#include "cuticle/groom/density_grid.h"

#endif  // CUTICLE_CUTICLE_H
