// Virtual lights that not all lobes or surfaces see: a method of its own for each kind of them, that shades what they
// light of the points. Kernels, bounds and trees know nothing of it.
#pragma once

#include "integrators/integrator.h"

namespace lumicut {

// The method for these lights: as the entry creates it where all of them light everything.
std::unique_ptr<Integrator> create_method(const IntegratorEntry& entry, const VplSet& lights);

}  // namespace lumicut
