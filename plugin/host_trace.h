// A host's tracer (lumicut_trace) as the Accel of a scene: in batches of the size it wants, with its ids checked.
#pragma once

#include "plugin/boundary.h"
#include "scene/scene.h"

namespace lumicut {

// Throws Error naming the field that is wrong.
Scene::AccelFactory host_trace(const lumicut_trace& in);

}  // namespace lumicut
