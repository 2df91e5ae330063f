// What hosts may want to know of an integrator before they choose it, from its line in integrator_list.inc.
#pragma once

#include "integrators/integrator.h"

namespace lumicut {

struct IntegratorTraits {
  bool saved_state = false;       // has save_state and load_state
  bool view_independent = false;  // another camera repeats no preparation: `shade` builds nothing over the points
  bool all_lights = false;        // sums every virtual light at every point
  // Parameters by purpose, "name=value name=value"; empty: no suggestion.
  const char *interactive = "", *preview = "", *draft = "", *good = "", *reference = "";
};

IntegratorTraits traits(const IntegratorEntry& entry);

}  // namespace lumicut
