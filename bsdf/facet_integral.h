// Numerical integration over the facets of a rough surface that a viewer sees: for tables, made once.
#pragma once

#include "bsdf/ggx_reflection.h"

namespace lumicut {

// Mean over the visible facets of what `share(view, half vector)` says that comes off them, about +z; kSteps² of them.
template <int kSteps = 20, typename Share>
float mean_over_facets(float alpha, float cosine_to_viewer, const Share& share) {
  const Vec3f view{std::sqrt(std::max(0.0f, 1.0f - cosine_to_viewer * cosine_to_viewer)), 0.0f, cosine_to_viewer};
  if (alpha <= 0.0f) return share(view, Vec3f{0, 0, 1});
  float sum = 0.0f;
  for (int i = 0; i < kSteps; ++i)
    for (int j = 0; j < kSteps; ++j)
      sum += share(view, sample_visible_normal(view, alpha, (static_cast<float>(i) + 0.5f) / kSteps,
                                               (static_cast<float>(j) + 0.5f) / kSteps));
  return sum / (kSteps * kSteps);
}

// Where x of 0 to 1 lies in a table of so many entries: the one before, and how far on to the next.
struct TablePlace {
  int cell;
  float rest;
};
inline TablePlace table_place(float x, int entries) {
  const float at = std::min(1.0f, std::max(0.0f, x)) * static_cast<float>(entries - 1);
  const int cell = std::min(entries - 2, static_cast<int>(at));
  return {cell, at - static_cast<float>(cell)};
}

// What one mirroring facet sends up and others do not mask.
inline float unmasked_reflection(float alpha, const Vec3f& view, const Vec3f& half) {
  const float up = reflect(view, half).z;
  return up > 0.0f ? masking_reflected(alpha * alpha, view.z, up) : 0.0f;
}

}  // namespace lumicut
