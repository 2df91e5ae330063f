// Points to shade, structure of arrays: what the hot loops read, one array a field, padded to kLanes.
#pragma once

#include <cstdint>
#include <vector>

#include "core/aabb.h"

namespace lumicut {

// Widest SIMD vector in floats; arrays are padded to it, so that loops need no tail.
inline constexpr size_t kLanes = 16;
inline constexpr size_t round_up_to_lanes(size_t n) { return (n + kLanes - 1) / kLanes * kLanes; }

// Which glossy lobes points have, as far as kernels tell: none; the papers' cosine lobe alone, with neither Fresnel's term
// nor a diffuse part that knows angles; or any of bsdf/lobes.h. Each stands for those before it too.
enum class Lobes : uint8_t { none, cosine, all };
inline constexpr uint32_t kCosineLobe = 0;  // its place in the list of bsdf/lobes.h

// A surface seen from one side: the shading normal is turned to the viewer.
struct SurfacePoint {
  Vec3f position;      // offset from the surface by the scene's epsilon: shadow rays start here
  Vec3f normal;        // unit, on the viewer's side
  Vec3f mirror;        // unit: the view direction mirrored about `normal`
  Rgb diffuse;         // kd/π
  Rgb specular;        // of the glossy lobe; cosine lobe: its factor before cosⁿβ; GGX: F0, at normal incidence
  Rgb grazing{};       // GGX: F90, at grazing incidence
  float shape = 0.0f;  // of the glossy lobe; cosine lobe: the exponent n; GGX: α = roughness², above 0
  float ior = 1.5f;    // GGX: of the dielectric whose Fresnel curve leads from specular to grazing
  uint32_t lobe = kCosineLobe;       // which one: its place in the list of bsdf/lobes.h
  float falloff = 0.0f;              // of the diffuse part towards grazing light (bsdf/lambert.h)
  float retro = 0.0f, dim = 0.0f;    // of the diffuse part, as Burley's is (bsdf/burley.h)
  float slope = 0.0f, again = 0.0f;  // of the diffuse part, as Oren and Nayar's is (bsdf/oren_nayar.h)
  uint32_t pixel = 0;                // points of one pixel lie together
  Vec3f smooth{};           // unit: before textures bent the normal, where that dims (bsdf/bump_shadow.h); else 0
  uint32_t not_lit_by = 0;  // sets of receivers that its mesh is not in (scene/ray_kind.h)

  bool burley() const { return retro > 0.0f || dim > 0.0f; }
  bool grooved() const { return slope > 0.0f; }
  // Whether its diffuse part is not Lambert's.
  bool lobed() const { return burley() || grooved() || falloff > 0.0f; }
  bool bent() const { return smooth != Vec3f{}; }
  Lobes lobes() const {
    if (lobe != kCosineLobe || falloff > 0.0f || burley() || grooved() || bent()) return Lobes::all;
    return max_component(specular) > 0.0f ? Lobes::cosine : Lobes::none;
  }
  // All light that it reflects, times `factor`: what a path has lost on its way here.
  void attenuate(const Rgb& factor) { diffuse *= factor, specular *= factor, grazing *= factor; }
};

struct ShadePoints {
  // position, normal, mirror, diffuse, specular, grazing, smooth: [component][point]
  std::vector<float> position[3], normal[3], mirror[3], diffuse[3], specular[3], grazing[3], smooth[3], shape, ior,
      falloff, retro, dim, slope, again;
  std::vector<uint32_t> lobe, pixel, not_lit_by;

  size_t size() const { return size_; }
  // Of any of the points: kernels skip what none has.
  Lobes lobes() const { return lobes_; }
  bool bent() const { return bent_; }
  bool grooved() const { return grooved_; }
  void clear();
  void reserve(size_t n);
  void push(const SurfacePoint& p);
  // Pads every array to a multiple of kLanes with copies of the last point. Call once, after the last push.
  void finish();
  SurfacePoint get(size_t i) const;
  Vec3f position_at(size_t i) const { return {position[0][i], position[1][i], position[2][i]}; }
  Vec3f normal_at(size_t i) const { return {normal[0][i], normal[1][i], normal[2][i]}; }

 private:
  size_t size_ = 0;
  Lobes lobes_ = Lobes::none;
  bool bent_ = false, grooved_ = false;  // any of the points
};

}  // namespace lumicut
