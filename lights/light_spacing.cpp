#include "lights/light_spacing.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "geometry/places.h"

namespace lumicut {

LightSpacing::LightSpacing(std::span<const Vpl> lights, float lonely, const Progress* progress)
    : places_(rows_of(lights, [](const Vpl& v) { return v.position; })), lonely_(lonely), tree_(places_, 3, progress) {}

// The `itself` nearest, 0 or 1, are not counted.
float LightSpacing::distance(const double* place, size_t itself, BallQueryTree::Scratch& scratch) const {
  std::array<double, kNeighbour + 1> dist2;
  const size_t found = tree_.nearest_distances(place, kNeighbour + itself, dist2.data(), scratch);
  if (found <= itself) return lonely_;
  const double farthest = std::sqrt(dist2[found - 1]);
  return static_cast<float>(farthest *
                            std::sqrt(static_cast<double>(kNeighbour) / static_cast<double>(found - itself)));
}

float LightSpacing::at(const Vec3f& position, BallQueryTree::Scratch& scratch) const {
  return distance(row_of(position).data(), 0, scratch);
}

float LightSpacing::of_light(size_t i, size_t beside, BallQueryTree::Scratch& scratch) const {
  const double* place = &places_[3 * i];
  if (beside == 0) return distance(place, 1, scratch);
  const size_t count = tree_.size(), first = i - std::min(i, beside), last = std::min(count, i + beside + 1);
  const size_t others = count - (last - first), wanted = std::min(kNeighbour, others);
  if (wanted == 0) return lonely_;
  std::array<double, kNeighbour> dist2;
  const BallQueryTree::Range without{static_cast<uint32_t>(first), static_cast<uint32_t>(last - first)};
  tree_.nearest_distances(place, wanted, dist2.data(), scratch, without);
  const double share = static_cast<double>(others) / static_cast<double>(count);
  return static_cast<float>(
      std::sqrt(dist2[wanted - 1] * share * static_cast<double>(kNeighbour) / static_cast<double>(wanted)));
}

}  // namespace lumicut
