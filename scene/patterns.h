// Regular patterns: waves, bricks, checkers, gradients, turbulence of sines. As Blender defines them.
#pragma once

#include "scene/noise.h"

namespace lumicut {

// 1 in the cells of the first colour, else 0.
float checker(const Vec3f& p);

enum class GradientKind : uint8_t { linear, quadratic, easing, diagonal, radial, quadratic_sphere, spherical };
float gradient(const Vec3f& p, GradientKind kind);

// Sines of sines, `depth` (0..10) times turned around by `distortion`.
Rgb magic(const Vec3f& p, int depth, float distortion);

enum class WaveDirection : uint8_t { x, y, z, diagonal };  // of rings: spherical
enum class WaveProfile : uint8_t { sine, saw, triangle };

struct WaveOptions {
  bool rings = false;
  WaveDirection direction = WaveDirection::x;
  WaveProfile profile = WaveProfile::sine;
  float distortion = 0.0f, detail = 2.0f, detail_scale = 1.0f, detail_roughness = 0.5f, phase = 0.0f;
};
float wave(const Vec3f& p, const WaveOptions& options);

struct BrickOptions {
  float offset = 0.5f, squash = 1.0f;  // of rows that are a multiple of the frequency
  int offset_frequency = 2, squash_frequency = 2;
  float mortar_size = 0.02f, mortar_smooth = 0.1f, bias = 0.0f, width = 0.5f, height = 0.25f;
};
struct Brick {
  float mortar, tint;  // shares of the mortar, and of the second colour in the brick
};
Brick brick(const Vec3f& p, const BrickOptions& options);

}  // namespace lumicut
