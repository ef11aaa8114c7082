// What each file binds.
#pragma once

#include <nanobind/nanobind.h>

namespace native {

void bind_densities(nanobind::module_ &m);
void bind_far_field(nanobind::module_ &m);
void bind_fit(nanobind::module_ &m);
void bind_groom(nanobind::module_ &m);
void bind_longitudinal(nanobind::module_ &m);
void bind_models(nanobind::module_ &m);
void bind_sampler(nanobind::module_ &m);

}  // namespace native
