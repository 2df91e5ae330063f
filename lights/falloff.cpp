#include "lights/falloff.h"

#include <numbers>

namespace lumicut {

float profile_share(const Vpl& v, const LightProfile* profile, const Vec3f& direction) {
  if (profile == nullptr) return 0.0f;
  const Vec3f tangent = v.tangent(), bitangent = cross(tangent, v.normal);
  const float vertical = std::acos(std::clamp(dot(direction, v.normal), -1.0f, 1.0f));
  const float horizontal = std::atan2(dot(direction, bitangent), dot(direction, tangent));
  return (*profile)(vertical, horizontal < 0.0f ? horizontal + static_cast<float>(2 * std::numbers::pi) : horizontal);
}

}  // namespace lumicut
