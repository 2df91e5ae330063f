// What the readers of pbrt's and Mitsuba's scenes share: shapes as meshes, textures as programs, metals, lights of any
// falloff. Everything in world space, y or z up as the file has it.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "io/affine.h"
#include "io/find_beside.h"
#include "io/scene_data.h"
#include "io/spectra.h"
#include "io/texture_store.h"

namespace lumicut::io {

inline constexpr double kPi = 3.14159265358979323846;
inline double radians(double degrees) { return degrees * kPi / 180; }

Affine translation(const Vec& v);
Affine scaling(const Vec& v);
Affine rotation(const Vec& axis, double angle);
// Nothing where there is none.
std::optional<Affine> inverse(const Affine& m);

// A mesh without its place and material.
struct Geometry {
  std::vector<float> positions, normals, uvs;
  std::vector<uint32_t> indices;
  std::vector<float> colours{};  // three a vertex, as the file has them; or empty
};
// Of radius 1 about the origin, its area that of the sphere; u around z, v from -z (0) to z (1).
Geometry sphere_geometry();
// The part of it between these z, around as far as `sweep`.
Geometry sphere_part_geometry(double z0, double z1, double sweep);
// Corners -1 to 1 in the plane z = 0, towards z; uv 0 to 1 along x and y.
Geometry rectangle_geometry();
// Corners -1 to 1; each face has uv 0 to 1.
Geometry cube_geometry();
// In the plane z = `height` about the z axis, towards z, of the disk's area.
Geometry disk_geometry(double height, double radius, double inner, double sweep);
// About the z axis, outwards, without lids.
Geometry cylinder_geometry(double radius, double z0, double z1, double sweep);

// Where on a texture a place of a surface is: `to` of (u, v, 0), or of the point in the world; then, on a sphere, by the
// angles to z and around it, on a cylinder by the angle around z and z. Angles become 0 to 1.
struct TexturePlace {
  enum class Kind { uv, point, sphere, cylinder };
  Affine to;
  Kind kind = Kind::uv;
};

// What a material's value is made of: a constant, or what is computed at the hit.
struct Paint;
using PaintRef = std::shared_ptr<const Paint>;
struct Paint {
  enum class Kind { constant, image, vertices, checker, axis, along, behind, product, mix, invert, power, coated };
  Kind kind = Kind::constant;
  Vec value{0, 0, 0};    // constant; power: the exponent in [0]; along: a direction, whose cosine to the normal it is;
                         // coated: what a coat reflects to its inside in [0]
  int32_t texture = 0;   // image
  uint32_t mode = 0;     // image: as LUMICUT_OP_IMAGE has it; axis: which coordinate
  TexturePlace place;    // image, checker (squares, or cubes), axis
  PaintRef a, b, share;  // checker, product, mix: a where share is 0
  size_t size = 1;       // with all that it is made of
};
PaintRef constant_paint(const Vec& value);
PaintRef constant_paint(double value);
PaintRef power_paint(PaintRef base, double exponent);
// The colour that `base` shows below a smooth dielectric of that index, over what it shows bare: light that the coat keeps
// inside meets the base again and again. [Egan and Hilgeman 1973; Jakob's plastic in Mitsuba, "nonlinear"]
PaintRef coated_paint(PaintRef base, double index);
PaintRef behind_paint();  // 1 where the back is seen
// What it is without the place; nothing where it depends on that.
std::optional<Vec> constant_of(const PaintRef& paint);

// Where a value of a scene stands: for warnings. Line 0: not known.
struct ValuePlace {
  std::string file;
  int line = 0;
  std::string name;  // "material \"floor\": reflectance"
};

class SceneBuilder {
 public:
  explicit SceneBuilder(std::string path) : path_(std::move(path)), textures_(scene.textures) {}

  SceneData scene;

  [[noreturn]] void fail(const std::string& where, const std::string& text) const;
  void leave_out(const std::string& what);    // once each
  void approximate(const std::string& what);  // once each

  // What is out of range is told and cut to it: numbers, and constants and factors of a material's values (the factors of
  // textures to [0, 1e6]).
  double cut(double value, double low, double high, const ValuePlace& place);
  PaintRef cut(const PaintRef& paint, double low, double high, const ValuePlace& place);

  // Image of that name beside the scene's file. 0, with a warning that says what is done, where it is missing.
  int32_t image(const std::string& name, TextureUse use, uint32_t flags, const char* else_done = "grey stands in");
  // A file beside the scene's, or in a folder that the scene names.
  FoundFile find(const std::string& name) const;
  void search_in(const std::string& folder) { folders_.push_back(folder); }
  TextureStore& textures() { return textures_; }
  const std::string& path() const { return path_; }

  // What is made of others: a constant where they are, and never of more than 500.
  PaintRef made(Paint paint) const;
  PaintRef product(const PaintRef& a, const PaintRef& b) const;
  PaintRef mixed(const PaintRef& a, const PaintRef& b, const PaintRef& share) const;
  static PaintRef image_paint(int32_t texture);
  static PaintRef vertex_paint();  // the colours of meshes' vertices; black where they have none
  // The mean of all texels, as if what is computed of them were linear; of places a half.
  Vec mean_of(const PaintRef& paint) const;

  // A colour of a material: factor and texture. Values are cut to [0, 1]: `cut` tells of it.
  void set_colour(const PaintRef& paint, float* factor, int32_t& texture);
  void set_number(const PaintRef& paint, float& factor, int32_t& texture);
  // Of the emission (a colour), and of an opacity.
  int32_t colour_texture(const PaintRef& paint) { return texture_of(decoded(paint, true)); }
  int32_t number_texture(const PaintRef& paint);
  // The surface stands out by so much: `scale` of the world's lengths for a height of 1.
  void set_bump(const PaintRef& height, double scale, lumicut_material& m);

  uint32_t add_material(const std::string& name, const lumicut_material& values);
  // The material with another emission.
  uint32_t with_emission(uint32_t material, const Vec& radiance, int32_t texture, bool both_sides);
  // Glass that absorbs inside, by 1/length; nothing where the material is no glass.
  std::optional<uint32_t> with_absorption(uint32_t material, const Vec& absorption);
  // The first where share is 0, the second where it is 1. What no single material can be is approximated, by name.
  uint32_t mix_materials(const std::string& name, uint32_t first, uint32_t second, const PaintRef& share);

  // `flipped`: what the winding says is the back. The same shape and material are stored once (`key`; "": alone).
  // `mask`: the rays that see it, as lumicut_mesh has it.
  void add(const std::string& name, const Geometry& geometry, const Affine& place, uint32_t material, bool flipped,
           const std::string& key = "", uint32_t mask = 0);
  // Meshes of a file, of any format that has no materials of its own or whose materials do not count.
  std::vector<Geometry> read_meshes(const std::string& name);

  void add_light(const lumicut_light& light, const std::string& name);
  // Of the light's `direction` and `tangent` the profile's angles are about; its `file` becomes the name.
  void add_profile_light(const Vec& position, const Vec& direction, const Vec& tangent, const Vec& colour,
                         Profile profile, const std::string& name);
  double exposure = 1;        // all light is multiplied by it
  bool emitters_seen = true;  // by the camera
  // What is not there is put in its place.
  SceneData finish(bool has_camera);

 private:
  int32_t compile(const PaintRef& paint, Program& program);
  int32_t texture_of(const PaintRef& paint);
  int32_t add_program(Program program);
  void hide_emitters();
  bool reads_vertices(uint32_t material) const;
  // The material of these values, made once of another one.
  uint32_t variant_of(uint32_t material, const lumicut_material& values, const char* what);
  // What set_colour and set_number made these of.
  PaintRef colour_of(const float* factor, int32_t texture) const;
  PaintRef number_of(float factor, int32_t texture) const;
  PaintRef decoded(const PaintRef& paint, bool colour) const;

  std::string path_;
  std::vector<std::string> folders_;
  TextureStore textures_;
  std::map<std::string, size_t> shared_;
  std::set<std::string> told_;
  std::map<const Paint*, std::pair<PaintRef, int32_t>> painted_;
  std::map<int32_t, PaintRef> made_of_;  // texture numbers
};

}  // namespace lumicut::io
