// How near virtual lights may come. Without a distance of the user's, as near as lets so many of them lie within it, so
// that one light can add no more than a small share of what its neighbourhood gives: bias and bright dots are balanced
// everywhere alike. docs/decisions/0018-lengths-are-local.md
#pragma once

#include <memory>

#include "integrators/common_params.h"
#include "lights/light_spacing.h"

namespace lumicut {

class Clamp {
 public:
  // For these lights, where they lie on their surfaces. Throws Error(cancelled).
  Clamp(const VplSet& set, const CommonParams& params, const Scene& scene, const Progress& progress);

  // Gives each light of the set its own. Throws Error(cancelled).
  void set_on(VplSet& set, const Progress& progress) const;
  // Squared distance of a virtual light that light paths put at this place.
  float at2(const Vec3f& position, BallQueryTree::Scratch& scratch) const;
  // How many of `count` lights lie within it, where it follows their spacing; 0: one distance for all. `clamp_lights` of
  // ten thousand, and otherwise as count^(2/3): bias falls as this over the count and noise as one over its root, so
  // that both vanish alike.
  double lights_among(uint64_t count) const;
  // The same for those on emitters: at least `clamp_lights`, since samples of the emitters bring back all that it takes.
  double lights_on_emitters(uint64_t count) const;
  float distance() const { return distance_; }

 private:
  float from_spacing2(float spacing) const;

  double of_ten_thousand_;
  double on_paths_ = 0.0, of_emitters_ = 0.0;  // lights_among those of either kind
  float distance_ = 0.0f;
  bool exact_points_;  // lights without extent, whose light nothing brings back, have none
  std::unique_ptr<const LightSpacing> spacing_;
};

}  // namespace lumicut
