// What a GGX lobe leaves of the light to what lies beneath it: a diffuse base, a coated surface.
// docs/decisions/0014-ggx.md
#pragma once

#include "bsdf/lambert.h"

namespace lumicut {

struct LobeTransmittance {
  float to_viewer;  // share that passes from the viewer's direction: 1 less the lobe's directional albedo there
  float falloff;    // of the light's directions: 1 − falloff·(1 − c)⁴, over its mean, is about as that share is
};

// Of a lobe with the reflectances f0 and f90 straight on and at grazing incidence, by Fresnel's curve of `ior` between
// them, seen at `cosine`. The first call integrates a table, some 30 ms. Of rough lobes of an index below .7 it is up
// to 5 % off, where total reflection begins.
LobeTransmittance lobe_transmittance(float f0, float f90, float ior, float alpha, float cosine);

}  // namespace lumicut
