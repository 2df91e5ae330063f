// Rows of the matrix of light transport: what every light gives to a few of the points, shadows included.
// [Hašan et al. 2007, sec. 4; Ou and Pellacini 2011, sec. 4]
// Departs: entries are luminance rather than three colours, kept in 16 bits: a sixth of the memory.
#pragma once

#include <bit>
#include <cstdint>
#include <vector>

#include "core/progress.h"
#include "lights/falloff.h"
#include "lights/vpl.h"
#include "scene/scene.h"

namespace lumicut {

// The upper half of a float: its whole range at 8 bits of precision, so that a matrix needs no scale.
inline uint16_t to_bfloat(float v) {
  const auto bits = std::bit_cast<uint32_t>(v);
  return static_cast<uint16_t>((bits + 0x7fffu + (bits >> 16 & 1u)) >> 16);  // to nearest even
}
inline float from_bfloat(uint16_t v) { return std::bit_cast<float>(static_cast<uint32_t>(v) << 16); }

// The lights that give any light, kind by kind, near ones together (Morton order): rays from one point to lights that
// follow each other are coherent, and order no longer depends on how the lights were made.
std::vector<Vpl> order_lights(const std::vector<Vpl>& lights, const Progress* progress = nullptr);

class LightMatrix {
 public:
  // Traces at most rows.size() · lights.size() shadow rays, on the caller's arena. `falloff` as in light_points;
  // what a light in shadow would give counts by `shadowed_share`. Takes 2 · stride() bytes a light. Throws
  // Error(cancelled).
  static LightMatrix build(const Scene& scene, const std::vector<Vpl>& lights, const ShadePoints& rows, Falloff falloff,
                           float shadowed_share, const Progress& progress);

  size_t rows() const { return rows_; }
  size_t columns() const { return stride_ == 0 ? 0 : values_.size() / stride_; }
  size_t stride() const { return stride_; }  // rows, padded to kLanes with zeros
  // Luminance of the radiance that the light gives to each row, W/(sr·m²): stride() values in bfloat.
  const uint16_t* column(size_t light) const { return values_.data() + light * stride_; }
  const uint16_t* values() const { return values_.data(); }
  uint64_t rays() const { return rays_; }
  // Sum of each row: the luminance that its point receives of all lights.
  const std::vector<double>& row_sums() const { return row_sums_; }

 private:
  size_t rows_ = 0, stride_ = 0;
  uint64_t rays_ = 0;
  std::vector<uint16_t> values_;
  std::vector<double> row_sums_;
};

}  // namespace lumicut
