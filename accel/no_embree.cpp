// In place of embree_accel.cpp where the build has no Embree.
#include "accel/embree_accel.h"
#include "core/error.h"

namespace lumicut {

bool has_embree() { return false; }

// accel_kind_of has refused the name.
std::unique_ptr<Accel> make_embree_accel(const AccelGeometry&, const AccelOptions&, Progress*) {
  throw Error(ErrorCode::internal, "there is no Embree in this build");
}

}  // namespace lumicut
