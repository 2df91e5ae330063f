// What shading trees do to colours, as Blender's nodes define it.
#pragma once

#include <cstdint>

#include "core/vec.h"

namespace lumicut {

// Hue, saturation and value (or lightness), all 0..1.
Vec3f hsv_of(const Rgb& c);
Rgb of_hsv(const Vec3f& hsv);
Vec3f hsl_of(const Rgb& c);
Rgb of_hsl(const Vec3f& hsl);

enum class BlendMode : uint8_t {
  mix,
  darken,
  multiply,
  burn,
  lighten,
  screen,
  dodge,
  add,
  overlay,
  soft_light,
  linear_light,
  difference,
  exclusion,
  subtract,
  divide,
  hue,
  saturation,
  color,
  value
};
inline constexpr uint32_t kBlendModes = 19;
Rgb blend(BlendMode mode, float share, const Rgb& a, const Rgb& b);

}  // namespace lumicut
