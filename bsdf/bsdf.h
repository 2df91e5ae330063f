// How a surface scatters light, as it is seen from one side: made once a hit, from the material's description there.
// Two kinds of lobes: those that virtual lights can shade, which lie in layers (SurfacePoint: the surface beneath, and a
// rough clear coat above it), and specular ones, too sharp for point lights, which rays follow: mirrors and glass.
// What leaves towards the viewer is the sum of all. docs/decisions/0014-ggx.md
#pragma once

#include <array>
#include <optional>
#include <span>

#include "bsdf/bsdf_parameters.h"
#include "bsdf/coat.h"
#include "bsdf/ggx_material.h"
#include "bsdf/point_bsdf.h"
#include "core/rng.h"

namespace lumicut {

// Where the surface lies and how it is seen. Unit vectors; `to_viewer` leads away from the surface.
struct SurfaceView {
  Vec3f position, geometric_normal, normal, to_viewer;
  float offset;  // of ray origins from the surface
  uint32_t pixel = 0;
  Vec3f smooth{};           // unit shading normal before textures bent it, where that dims (bsdf/bump_shadow.h); else 0
  uint32_t not_lit_by = 0;  // of its mesh
};

// The continuation of a light path: its flux is multiplied by weight · factor (which holds the chance of the roulette).
struct ScatterSample {
  Vec3f direction;
  Rgb weight{};
  float factor = 1.0f;
  uint32_t flags = 0;
};

// The continuation of a camera path, by chance: along a specular lobe, or from a layer that lights are sampled at.
// Neither: it ends.
struct PathChoice {
  std::optional<BsdfSample> specular;
  const SurfacePoint* layer = nullptr;
  float probability = 1.0f;  // of this choice: to divide by
};

// How a ray goes through glass: bent, as the camera sees it, or, where the material says that shadows pass, straight on, as
// light does on its way to the first surface that is seen.
enum class Passage : uint8_t { refracted, straight, straight_from_light };

class Bsdf {
 public:
  Bsdf() = default;
  Bsdf(const BsdfParameters& parameters, const SurfaceView& view);

  // What virtual lights shade, from beneath to above, and last the other side of what lets light through evenly: one
  // point, or up to three.
  std::span<const SurfacePoint> layers() const { return {layers_.data(), layer_count_}; }
  // Sets of receivers that its mesh is not in.
  uint32_t not_lit_by() const { return layers_[0].not_lit_by; }
  // Whether there is a lobe that rays must follow.
  bool is_specular() const { return specular_; }
  // The shading normal on the viewer's side.
  const Vec3f& normal() const { return normal_; }
  // Where a ray goes out that such a sample leads along.
  Vec3f origin(uint32_t flags) const { return position_ + side_ * ((flags & kTransmitted) != 0 ? -offset_ : offset_); }

  // Sum over the layers, without the cosine. 1/sr
  Rgb evaluate(const Vec3f& to_light) const;
  // Of the layers, each chosen by what it reflects; specular lobes have none.
  float pdf(const Vec3f& direction) const;
  // Base colour and F0 together, at most 1: what an albedo pass shows.
  Rgb albedo() const { return min(diffuse_color_ + specular_color_ + parameters_.translucency, Rgb{1, 1, 1}); }
  // Of one kind of lobes: what leaves evenly, what is reflected otherwise, what goes through glass.
  Rgb even_color() const { return diffuse_color_ + parameters_.translucency; }
  Rgb reflected_color() const { return specular_color_; }
  Rgb passed_color() const { return parameters_.model == LobeModel::ggx ? colors_.base * colors_.clear : Rgb{}; }
  // Intensity of the virtual light that stands for what is reflected evenly of this flux: Lambertian, of the same power.
  Rgb lambertian_intensity(const Rgb& flux) const;
  // The same for what leaves on the other side; 0 where nothing does.
  Rgb passed_intensity(const Rgb& flux) const;

  // One direction out of the layers, chosen by what they reflect.
  std::optional<BsdfSample> sample(float layer, float choice, float u, float v) const;
  // One direction out of the specular lobes: metal, dielectric and coats of α below kLeastAlpha, and glass, which
  // reflects or refracts by chance of its Fresnel reflectance. `choice`, `u`, `v` in [0, 1). Empty where there is no such
  // lobe, or where the light is lost in it. The mean weight is at most 1 (of one direction through rough glass it may be
  // more: what others lose is given back); solid angles that refraction narrows are not in it, since a closed body
  // widens them again.
  std::optional<BsdfSample> sample_specular(float choice, float u, float v, Passage passage = Passage::refracted) const;
  // The same with nothing chosen: a direction of each way that there is, with what it carries alone.
  std::array<std::optional<BsdfSample>, 3> specular_ways(float u, float v, Passage passage) const;
  // One direction out of all lobes for a light path, with Russian roulette by what they reflect, which keeps the flux of
  // all paths alike but for that factor of refraction: here it is, so that a single sheet looks as camera paths see it.
  // Straight through glass, where shadows pass. What leaves evenly does so by the geometric normal.
  std::optional<ScatterSample> scatter(Rng& rng) const;
  // Of a path behind the first surface that lights are sampled at: straight through glass, where shadows pass.
  PathChoice choose(Rng& rng) const;
  // What absorbs a ray that leaves by a sample with such flags, for each unit of length; `before`: what absorbed the one
  // that came. Glass inside glass absorbs beside the outer one.
  Rgb absorption_after(uint32_t flags, const Rgb& before) const {
    const Rgb here = absorption_to(before);
    if ((flags & kTransmitted) == 0) return here;
    return behind_ ? here - parameters_.absorption : here + parameters_.absorption;
  }
  // Share of light that is left after `distance` on the way to this surface. [Beer, Lambert]
  Rgb transmittance_to(float distance, const Rgb& before) const {
    const Rgb a = absorption_to(before);
    if (!(max_component(a) > 0.0f)) return {1, 1, 1};
    return {std::exp(-a.x * distance), std::exp(-a.y * distance), std::exp(-a.z * distance)};
  }
  // Whether some light goes straight on.
  bool passes_straight() const { return specular_ && parameters_.shadows_pass; }

 private:
  enum class Way : uint8_t { reflected, coat, passed };
  // `way`: that one alone; none: chosen by what each carries.
  std::optional<BsdfSample> specular_way(std::optional<Way> way, float choice, float u, float v, Passage passage) const;
  // On the way to this surface: seen from inside, at least its own, whatever is known of where the ray set out.
  Rgb absorption_to(const Rgb& before) const { return behind_ ? max(before, parameters_.absorption) : before; }
  std::optional<ScatterSample> scatter_cosine(Rng& rng) const;
  void add_other_side();
  size_t layer_at(const std::array<float, 3>& shares, float choice) const;
  // Each layer's chance: by what it reflects.
  std::array<float, 3> layer_shares() const;
  bool translucent() const { return max_component(parameters_.translucency) > 0.0f; }
  // Which side a layer's light leaves on.
  uint32_t side_of(size_t layer) const {
    return translucent() && layer + 1 == layer_count_ ? kTransmitted : kReflected;
  }

  BsdfParameters parameters_;
  GgxColors colors_{};
  std::array<SurfacePoint, 3> layers_;
  uint32_t layer_count_ = 0;
  bool specular_ = false, behind_ = false;
  Vec3f position_, side_, normal_, to_viewer_;  // both normals on the viewer's side; `side_` is the geometric one
  float offset_ = 0.0f;
  Rgb diffuse_color_{}, specular_color_{};
};

}  // namespace lumicut
