// Which light profiles there are in the process, by name: a host's virtual lights name those of scenes and lights that it
// has. Nothing is kept alive by its name.
#pragma once

#include "scene/light_profile.h"

namespace lumicut {

// One of the same content where somebody has it, else this. From any thread.
ProfileRef shared_profile(LightProfile profile);
// nullptr: nobody has one of that name. Of several, which may share a name by chance, the newest.
ProfileRef named_profile(uint32_t id);

}  // namespace lumicut
