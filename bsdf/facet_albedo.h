// What Smith's model of GGX facets loses, as it counts light that meets one facet alone: in life it goes on to others.
// Tables, integrated numerically once.
#pragma once

#include <vector>

namespace lumicut {

// Share of light from `cosine` to the normal that mirroring facets lose; and its mean over light from all sides.
float facet_loss(float alpha, float cosine);
float mean_facet_loss(float alpha);

// Share of even white light that glass facets with Fresnel's border keep: reflected and refracted together. To divide
// by, as Turquin (2019) does for metals. Takes some 10 ms for an index of refraction.
class GlassAlbedo {
 public:
  explicit GlassAlbedo(float ior);
  float ior() const { return ior_; }
  // Of light to a viewer at `cosine` to the normal, from inside of the glass or outside; α of 0 to 1. To about 1.5 %.
  float at(bool inside, float alpha, float cosine) const;
  // The part of that which is refracted, seen from outside.
  float passed(float alpha, float cosine) const;

 private:
  float ior_;
  std::vector<float> table_;  // outside, inside
  std::vector<float> passed_;
};

}  // namespace lumicut
