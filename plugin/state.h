// The table of extension "lumicut.state/1" (lumicut_state.h).
#pragma once

namespace lumicut {

const void* state_extension();

}  // namespace lumicut
