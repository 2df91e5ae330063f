// Measured lamps: intensity by direction, as photometric files have it. Tables live as long as somebody holds them and
// are named by a hash of their content, so that VPLs carry the name through files, states and kernels alike.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/fields.h"
#include "core/vec.h"

namespace lumicut {

class LightProfile {
 public:
  // `vertical`: angles from the axis, radians, rising within [0, π], at least two. `horizontal`: angles about it,
  // rising from 0 to 2π, or a single one: the same all around. `values`: vertical.size() for each horizontal angle, not
  // below 0 and not all 0. Throws Error naming the value.
  LightProfile(std::vector<float> vertical, std::vector<float> horizontal, std::vector<float> values);

  float largest() const { return largest_; }
  // Share of the largest value towards these angles: bilinear between the table's, 0 beyond its vertical ones.
  float operator()(float vertical, float horizontal) const;
  // ∫ share dω, exact.
  double solid_angle() const { return cdf_.back(); }
  // Cosine of the angle from the axis beyond which there is nothing.
  float cos_outer() const { return cos_outer_; }
  // A direction by its share of the flux (u, v in [0,1)) and its density per steradian.
  void sample(double u, float v, float w, float& vertical, float& horizontal, float& pdf) const;

  uint32_t id() const { return id_; }
  bool operator==(const LightProfile&) const = default;

 private:
  float value(size_t h, size_t v) const { return values_[h * vertical_.size() + v]; }
  size_t columns() const { return horizontal_.size() == 1 ? 1 : horizontal_.size() - 1; }

  std::vector<float> vertical_, horizontal_, values_;
  std::vector<double> cdf_;  // of flux over cells
  float largest_ = 0, cos_outer_ = -1;
  uint32_t id_ = 0;
  LUMICUT_FIELDS(LightProfile, vertical_, horizontal_, values_, cdf_, largest_, cos_outer_, id_)
};

using ProfileRef = std::shared_ptr<const LightProfile>;

// One of the same content is kept once. Its name is never 0. Throws Error where 4096 are kept already.
ProfileRef keep_profile(LightProfile profile);
// Of that name, where somebody holds it.
ProfileRef hold_profile(uint32_t id);
// The same for those who know that it is held meanwhile: lock-free. nullptr: none of that name.
const LightProfile* find_profile(uint32_t id);

// All that these lights (lamps, or virtual ones) name, each once. Throws Error where nobody holds one of them.
template <typename Lights>
std::vector<ProfileRef> hold_profiles(const Lights& lights) {
  std::vector<uint32_t> ids;
  for (const auto& light : lights)
    if (light.profile != 0 && (ids.empty() || ids.back() != light.profile)) ids.push_back(light.profile);
  std::sort(ids.begin(), ids.end());
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
  std::vector<ProfileRef> held;
  for (const uint32_t id : ids) {
    held.push_back(hold_profile(id));
    if (held.back() == nullptr) fail_argument("light profile " + std::to_string(id) + ": no scene and no light has it");
  }
  return held;
}

}  // namespace lumicut
