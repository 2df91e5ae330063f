// Point and spot lamps with a radius, as virtual lights whose place on the lamp follows the point that they light.
//
// A disk that faces each point, evenly lit, is what Cycles had before 4.0; then spheres. Places are drawn in the ball with
// the density 1/sqrt(r² − R²): projected along any direction they fill a disk evenly. So each light has one place for good,
// which is projected onto the disk that faces a point; and light that leaves the places of the ball evenly has the radiance
// of the sphere, at every point outside of it, as all chords of one distance from the centre carry the same.
#pragma once

#include <cmath>

#include "lights/vpl.h"

namespace lumicut {

// A place in the unit ball for u, v, w in [0,1): three coordinates of an even point of the sphere in four dimensions.
// [Shoemake 1992]
inline Vec3f place_in_ball(float u, float v, float w) {
  constexpr float kTwoPi = 6.28318530718f;
  const float a = std::sqrt(1.0f - u), b = std::sqrt(u);
  return {a * std::cos(kTwoPi * v), a * std::sin(kTwoPi * v), b * std::cos(kTwoPi * w)};
}

// Where the lamp's light is on the disk that faces `point`: where shadow rays end. At the centre all directions are alike.
inline Vec3f place_facing(const Vpl& v, const Vec3f& point) {
  const Vec3f centre = v.position - v.from_centre, axis = point - centre;
  const float d2 = length2(axis);
  return d2 > 0.0f ? v.position - axis * (dot(axis, v.from_centre) / d2) : v.position;
}

}  // namespace lumicut
