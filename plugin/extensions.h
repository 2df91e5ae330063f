// The tables of optional extensions.
#pragma once

namespace lumicut {

const void* hits_extension();     // "lumicut.hits/1" (lumicut_hits.h)
const void* lights_extension();   // "lumicut.lights/1" (lumicut_lights.h)
const void* presets_extension();  // "lumicut.presets/1" (lumicut_presets.h)
const void* state_extension();    // "lumicut.state/1" (lumicut_state.h)

}  // namespace lumicut
