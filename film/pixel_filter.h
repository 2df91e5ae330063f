// Filters of pixels by where samples fall: a sample is drawn from the filter around its pixel, and counts in that pixel alone,
// so that noise of neighbours stays apart. [Ernst et al. 2006: filter importance sampling; widths as in Cycles]
#pragma once

#include <cstdint>
#include <vector>

#include "core/fields.h"

namespace lumicut {

struct PixelFilter {
  enum class Kind : uint32_t { box = 0, gaussian = 1, blackman_harris = 2 };
  Kind kind = Kind::box;
  float width = 1.0f;  // pixels
  LUMICUT_FIELDS(PixelFilter, kind, width)
  bool operator==(const PixelFilter&) const = default;
};

class FilterSampler {
 public:
  explicit FilterSampler(const PixelFilter& filter);
  // Distance from the pixel's centre along one axis for u in [0,1); of the plain box u − 1/2.
  float offset(float u) const;

 private:
  std::vector<float> inverse_;  // of the distribution, at even steps of u; empty: the plain box
};

}  // namespace lumicut
