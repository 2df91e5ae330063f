// Backend: Embree 3 or 4. Only the factory is public; make_accel validates first.
#pragma once

#include "accel/accel.h"

namespace lumicut {

// Whether this build has Embree (CMake's LUMICUT_EMBREE).
bool has_embree();

// Throws Error(unsupported) without it, Error(out_of_memory), Error(cancelled), or Error(internal)
// with Embree's own text.
std::unique_ptr<Accel> make_embree_accel(const AccelGeometry& geometry, const AccelOptions& options,
                                         Progress* progress);

}  // namespace lumicut
