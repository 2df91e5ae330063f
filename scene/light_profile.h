// Measured lights: intensity by direction, as photometric files have it. Tables belong to the scene whose lights use
// them, and to the virtual lights made of these. Each is named by a hash of its content, so that lights carry the name
// through files, states and kernels alike.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/fields.h"

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

// Those that a scene's lights use, or a set of virtual lights. One holder's names say nothing about another's.
class LightProfiles {
 public:
  // One of the same content is kept once. Throws Error where another has its name by chance.
  void add(const ProfileRef& profile);
  // nullptr: none of that name.
  const LightProfile* find(uint32_t id) const { return hold(id).get(); }
  const ProfileRef& hold(uint32_t id) const;
  // The other's tables beside its own, and in place of those of the same name.
  void prefer(const LightProfiles& other);

 private:
  std::vector<ProfileRef> tables_;  // their names rise
  LUMICUT_FIELDS(LightProfiles, tables_)
};

}  // namespace lumicut
