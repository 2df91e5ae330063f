// Random points, lights and clusters of every kind and size.
#pragma once

#include <array>
#include <memory>

#include "clustering/light_tree.h"
#include "lights/falloff.h"
#include "lights/vpl.h"
#include "tests/support/test_scenes.h"

namespace lumicut::test {

inline SurfacePoint random_surface(Rng& rng, float half, bool glossy) {
  SurfacePoint p;
  p.position = random_point(rng, half);
  p.normal = random_direction(rng);
  p.mirror = random_direction(rng);
  if (dot(p.mirror, p.normal) < 0) p.mirror = -p.mirror;
  p.diffuse = {rng.next_float() * 0.3f, rng.next_float() * 0.3f, rng.next_float() * 0.3f};
  if (glossy && rng.next_float() < 0.8f) {
    p.shape = std::pow(1000.0f, rng.next_float());
    p.specular =
        Rgb{rng.next_float(), rng.next_float(), rng.next_float()} * cosine_lobe_scale(rng.next_below(2) == 0, p.shape);
    if (rng.next_below(2) == 0) {
      p.lobe = kLobe<GgxReflection>, p.shape = std::pow(0.01f, rng.next_float());
      const float bright = rng.next_below(3) == 0 ? 1.0f + rng.next_float() : 1.0f;  // of what facets reflect again
      p.specular = Rgb{rng.next_float(), rng.next_float(), rng.next_float()} * bright;
      p.grazing = Rgb{rng.next_float(), rng.next_float(), rng.next_float()} * bright, p.falloff = rng.next_float();
      p.ior = rng.next_below(8) == 0 ? 0.5f + 0.5f * rng.next_float() : 1.0f + 4.0f * rng.next_float();
    }
    if (rng.next_below(3) == 0) {
      const float share = rng.next_float();
      p.retro = 2.0f * rng.next_float() * share, p.dim = 0.5f * share;
    }
    if (rng.next_below(3) == 0) p.slope = rng.next_float(), p.again = 0.5f * rng.next_float();
    if (rng.next_below(4) == 0) p.diffuse = {};
    if (rng.next_below(4) == 0) p.smooth = normalize(p.normal + random_direction(rng) * rng.next_float());
  }
  return p;
}

inline ShadePoints random_points(Rng& rng, size_t n, float half, bool glossy) {
  ShadePoints points;
  for (size_t i = 0; i < n; ++i) points.push(random_surface(rng, half, glossy));
  points.finish();
  return points;
}

inline const std::array<ProfileRef, 2>& random_tables() {
  static const std::array<ProfileRef, 2> tables = {
      std::make_shared<LightProfile>(std::vector<float>{0.0f, 0.7f, 1.1f, 3.1f}, std::vector<float>{0.0f},
                                     std::vector<float>{1.0f, 3.0f, 0.5f, 0.1f}),
      std::make_shared<LightProfile>(std::vector<float>{0.0f, 0.5f, 1.0f, 1.5f},
                                     std::vector<float>{0.0f, 1.5f, 4.0f, 6.2831853f},
                                     std::vector<float>{1, 2, 1, 0, 1, 0, 3, 0, 1, 4, 0, 0, 1, 2, 1, 0})};
  return tables;
}
// Those that random lights have.
inline const LightProfiles& random_profiles() {
  static const LightProfiles all = [] {
    LightProfiles p;
    for (const ProfileRef& table : random_tables()) p.add(table);
    return p;
  }();
  return all;
}

// A lobe of Oren and Nayar's, of Burley's, or of both at once, beneath gloss or not, for light from anywhere above the normal.
inline void set_random_lobe(Rng& rng, Vpl& v) {
  Vec3f mirror = random_direction(rng);
  if (rng.next_below(4) == 0) mirror = normalize(mirror * 0.05f + Frame(v.normal).t);  // grazing
  if (dot(mirror, v.normal) < 0) mirror = -mirror;
  v.blend_cosine = mirror.x, v.spot_cosine = mirror.y, v.spread_tan = mirror.z;
  if (rng.next_below(2) == 0) v.falloff = rng.next_float();
  const uint32_t lobes = rng.next_below(3);
  if (lobes != 0) v.edge_or_radius = rng.next_float(), v.again = 0.5f * rng.next_float();
  if (lobes == 1) return;
  const float share = rng.next_float();
  v.retro = 2.0f * rng.next_float() * share, v.dim = 0.5f * share;
}

inline Vpl random_light(Rng& rng, VplKind kind, float half) {
  Vpl v;
  v.kind = kind;
  v.position = random_point(rng, half);
  v.normal = kind == VplKind::omni ? Vec3f{} : random_direction(rng);
  v.intensity = {rng.next_float(), rng.next_float(), rng.next_float()};
  if (kind == VplKind::lobed) set_random_lobe(rng, v);
  if (kind == VplKind::sphere) v.radius() = std::pow(10.0f, 0.3f - 2.3f * rng.next_float());
  if (kind == VplKind::spot) {
    v.cos_outer() = 1.6f * rng.next_float() - 0.8f;
    v.blend_cosine = rng.next_below(3) == 0 ? 0.0f : (1.0f - v.cos_outer()) * rng.next_float();
    v.spot_cosine = static_cast<float>(rng.next_below(2));
    v.spread_tan = rng.next_below(2) == 0 ? 0.0f : 4.0f * rng.next_float();
    if (v.spread_tan > 0) v.spot_cosine = 1.0f;
    if (rng.next_below(4) == 0) {
      v.facing = true, v.lamp_radius = half * rng.next_float();
      v.from_centre = random_direction(rng) * v.lamp_radius;
    }
    if (rng.next_below(3) == 0) {
      const LightProfile& profile = *random_tables()[rng.next_below(2)];
      v.profile = profile.id();
      const Vec3f tangent = Frame(v.normal).t;
      v.cos_outer() = profile.cos_outer();
      v.blend_cosine = tangent.x, v.spot_cosine = tangent.y, v.spread_tan = tangent.z;
    }
  }
  return v;
}

inline std::vector<Vpl> mixed_lights(size_t n) {
  std::vector<Vpl> lights;
  Rng rng(5, Stage::test);
  for (size_t i = 0; i < n; ++i) lights.push_back(random_light(rng, static_cast<VplKind>(rng.next_below(4)), 2.0f));
  return lights;
}

inline std::vector<uint32_t> lights_below(const LightTree& tree, uint32_t root) {
  std::vector<uint32_t> lights, stack{root};
  while (!stack.empty()) {
    const LightNode& node = tree.node(stack.back());
    stack.pop_back();
    if (node.leaf())
      lights.push_back(node.light);
    else
      stack.push_back(node.first_child), stack.push_back(node.first_child + 1);
  }
  return lights;
}

// Lights gathered around a place and a direction, from tight to everywhere.
inline std::vector<Vpl> random_cluster(Rng& rng, VplKind kind, size_t n) {
  const Vec3f center = random_point(rng, 1.5f), axis = random_direction(rng);
  const float spread = std::pow(10.0f, -3.0f * rng.next_float()),
              turn = std::pow(10.0f, 0.5f - 3.0f * rng.next_float());
  std::vector<Vpl> lights;
  for (size_t i = 0; i < n; ++i) {
    Vpl v = random_light(rng, kind, 1.0f);
    v.position = center + v.position * spread;
    if (kind != VplKind::omni) v.normal = normalize(axis + random_direction(rng) * turn);
    if (v.profile != 0) {
      const Vec3f tangent = Frame(v.normal).t;
      v.blend_cosine = tangent.x, v.spot_cosine = tangent.y, v.spread_tan = tangent.z;
    }
    if (kind == VplKind::lobed) set_random_lobe(rng, v);
    lights.push_back(v);
  }
  return lights;
}

}  // namespace lumicut::test
