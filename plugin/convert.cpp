#include "plugin/convert.h"

#include <unistd.h>

#include <numbers>

#include "accel/bvh_build.h"
#include "core/parallel.h"
#include "plugin/check.h"
#include "plugin/convert_program.h"
#include "plugin/descriptors.h"
#include "plugin/profile_names.h"

namespace lumicut {

namespace {

constexpr float kPi = std::numbers::pi_v<float>;
constexpr float kInf = std::numeric_limits<float>::infinity();
constexpr uint32_t kMaxGroup = 0xffff;
// Below this opening angle 1 − cos(half) drowns in single precision.
constexpr float kMinAngle = 0.002f;

Vec3f vec(const float (&v)[3]) { return {v[0], v[1], v[2]}; }
Vec3d vec_double(const float (&v)[3]) { return {v[0], v[1], v[2]}; }

int32_t texture_index(const FieldValidator& c, const char* name, int32_t one_based) {
  if (one_based < 0) c.fail(name, number_text(int64_t{one_based}) + " is negative; 0 means none, 1 the first texture");
  return one_based - 1;
}

// Cosine of the angle between two edges; 1 where one has no length.
double edge_cosine(const Vec3d& a, const Vec3d& b) {
  const double l = length(a) * length(b);
  return l > 0 ? std::abs(dot(a, b)) / l : 1.0;
}

void check_count(const FieldValidator& c, const char* name, uint64_t count) { c.integer(name, count, 0, 0xfffffffeu); }

const char* type_name(uint32_t type) {
  static constexpr const char* kNames[] = {"point", "spot", "rectangle", "disk", "sun"};
  return kNames[type];
}

}  // namespace

Scene::Config to_accel(const char* owner, uint32_t robust, const char* kind, const char* builder) {
  const FieldValidator c(owner);
  c.integer("robust", robust, 0, LUMICUT_FAST);
  Scene::Config out;
  out.robust = robust != LUMICUT_FAST;
  if (kind != nullptr) out.accel = accel_kind_of(kind);
  if (builder == nullptr) return out;
  if (out.accel == "embree") c.fail_unknown("builder", "\"embree\" has one builder of its own");
  build_options_of(out.builder = builder);
  return out;
}

Texture to_texture(const lumicut_texture& in, uint64_t index) {
  const FieldValidator c("lumicut_texture", index);
  if (in.program != nullptr) {
    const auto none = [&](const char* name, uint64_t value) {
      if (value != 0) c.fail(name, number_text(value) + " is not 0, as `program` needs it");
    };
    none("width", in.width), none("height", in.height), none("channels", in.channels);
    none("format", in.format), none("flags", in.flags);
    if (in.pixels != nullptr) c.fail("pixels", "is not NULL, as `program` needs it");
    return Texture(to_program(in.program, index));
  }
  c.integer("width", in.width, 1, 65536);
  c.integer("height", in.height, 1, 65536);
  c.integer("channels", in.channels, 1, 4);
  c.integer("format", in.format, LUMICUT_UINT8, LUMICUT_FLOAT32);
  c.flags("flags", in.flags, LUMICUT_SRGB | LUMICUT_CLAMP | LUMICUT_NEAREST | LUMICUT_BY_VIEW | LUMICUT_BLEND_STORED);
  const bool by_view = (in.flags & LUMICUT_BY_VIEW) != 0;
  if (by_view && in.width % 2 != 0)
    c.fail("width", number_text(uint64_t{in.width}) + " is not even, as LUMICUT_BY_VIEW needs it");
  if ((in.flags & LUMICUT_BLEND_STORED) != 0 && (in.flags & LUMICUT_SRGB) == 0)
    c.fail("flags", "holds LUMICUT_BLEND_STORED without LUMICUT_SRGB");
  if (in.pixels == nullptr) c.fail("pixels", "is NULL");
  Texture::Options options;
  options.srgb = (in.flags & LUMICUT_SRGB) != 0;
  options.by_view = by_view;
  options.clamp = by_view || (in.flags & LUMICUT_CLAMP) != 0;
  options.nearest = (in.flags & LUMICUT_NEAREST) != 0;
  options.blend_stored = (in.flags & LUMICUT_BLEND_STORED) != 0;
  return {in.width,    in.height,
          in.channels, in.format == LUMICUT_UINT8 ? Texture::Format::uint8 : Texture::Format::float32,
          options,     in.pixels};
}

Material to_material(const lumicut_material& in, uint64_t index) {
  const FieldValidator c("lumicut_material", index);
  c.flags("flags", in.flags,
          LUMICUT_EMIT_BOTH_SIDES | LUMICUT_PHONG | LUMICUT_GGX | LUMICUT_NO_FRESNEL | LUMICUT_BURLEY |
              LUMICUT_SHADOWS_PASS | LUMICUT_HOLDOUT | LUMICUT_BUMP_SHADOWS | LUMICUT_OREN_NAYAR | LUMICUT_FACETS_ONCE |
              LUMICUT_OPEN_GLASS | LUMICUT_BRIGHT_LOBE | LUMICUT_DIFFUSE_ONCE);
  if ((in.flags & LUMICUT_PHONG) != 0 && (in.flags & LUMICUT_GGX) != 0)
    c.fail("flags", "holds both LUMICUT_PHONG and LUMICUT_GGX");
  if ((in.flags & LUMICUT_NO_FRESNEL) != 0) {
    if ((in.flags & LUMICUT_GGX) == 0) c.fail("flags", "holds LUMICUT_NO_FRESNEL without LUMICUT_GGX");
    if (in.metallic > 0.0f) c.fail("metallic", "must be 0 with LUMICUT_NO_FRESNEL");
    if (in.transmission > 0.0f) c.fail("transmission", "must be 0 with LUMICUT_NO_FRESNEL");
  }
  if ((in.flags & LUMICUT_BURLEY) != 0) {
    if ((in.flags & LUMICUT_GGX) == 0) c.fail("flags", "holds LUMICUT_BURLEY without LUMICUT_GGX");
    if ((in.flags & LUMICUT_NO_FRESNEL) != 0) c.fail("flags", "holds both LUMICUT_BURLEY and LUMICUT_NO_FRESNEL");
    if (in.diffuse_roughness > 0.0f) c.fail("diffuse_roughness", "must be 0 with LUMICUT_BURLEY");
  }
  if ((in.flags & LUMICUT_OREN_NAYAR) != 0 && (in.flags & LUMICUT_GGX) != 0)
    c.fail("flags", "holds both LUMICUT_OREN_NAYAR and LUMICUT_GGX");
  if ((in.flags & LUMICUT_FACETS_ONCE) != 0 && (in.flags & (LUMICUT_OREN_NAYAR | LUMICUT_GGX)) == 0)
    c.fail("flags", "holds LUMICUT_FACETS_ONCE without LUMICUT_OREN_NAYAR or LUMICUT_GGX");
  if ((in.flags & LUMICUT_DIFFUSE_ONCE) != 0 && (in.flags & LUMICUT_GGX) == 0)
    c.fail("flags", "holds LUMICUT_DIFFUSE_ONCE without LUMICUT_GGX");
  if ((in.flags & LUMICUT_BRIGHT_LOBE) != 0) {
    if ((in.flags & LUMICUT_GGX) == 0) c.fail("flags", "holds LUMICUT_BRIGHT_LOBE without LUMICUT_GGX");
    if ((in.flags & LUMICUT_FACETS_ONCE) != 0)
      c.fail("flags", "holds both LUMICUT_BRIGHT_LOBE and LUMICUT_FACETS_ONCE");
  }
  if ((in.flags & LUMICUT_OPEN_GLASS) != 0 && (in.flags & LUMICUT_SHADOWS_PASS) == 0)
    c.fail("flags", "holds LUMICUT_OPEN_GLASS without LUMICUT_SHADOWS_PASS");
  if ((in.flags & LUMICUT_SHADOWS_PASS) != 0) {
    if ((in.flags & LUMICUT_GGX) == 0) c.fail("flags", "holds LUMICUT_SHADOWS_PASS without LUMICUT_GGX");
    if (!(in.transmission > 0.0f)) c.fail("transmission", "must be above 0 with LUMICUT_SHADOWS_PASS");
  }
  // Of a textured colour the product must be a share, not the factor: Scene::bsdf_parameters sees to that.
  constexpr float kLargestFactor = 1e6f;
  c.range("diffuse", in.diffuse, 0.0f, in.diffuse_texture > 0 ? kLargestFactor : 1.0f);
  c.range("specular", in.specular, 0.0f, in.specular_texture > 0 ? kLargestFactor : 1.0f);
  c.range("translucency", in.translucency, 0.0f, in.translucency_texture > 0 ? kLargestFactor : 1.0f);
  c.range("shininess", in.shininess, 0.0f, 1e6f);
  c.range("opacity", in.opacity, 0.0f, 1.0f);
  c.not_negative("emission", in.emission);
  c.range("roughness", in.roughness, 0.0f, 1.0f);
  c.range("diffuse_roughness", in.diffuse_roughness, 0.0f, 1.0f);
  c.range("metallic", in.metallic, 0.0f, 1.0f);
  if (in.ior != 0.0f) c.range("ior", in.ior, 0.1f, 10.0f);
  c.range("transmission", in.transmission, 0.0f, 1.0f);
  c.range("coat", in.coat, 0.0f, 1.0f);
  c.range("coat_roughness", in.coat_roughness, 0.0f, 1.0f);
  if (in.coat_ior != 0.0f) c.range("coat_ior", in.coat_ior, 1.0f, 10.0f);
  Material m;
  m.diffuse = vec(in.diffuse);
  m.specular = vec(in.specular);
  m.shininess = in.shininess;
  if ((in.flags & LUMICUT_PHONG) != 0) m.lobe = LobeModel::phong;
  if ((in.flags & LUMICUT_GGX) != 0) m.lobe = LobeModel::ggx;
  m.fresnel = (in.flags & LUMICUT_NO_FRESNEL) == 0;
  m.burley = (in.flags & LUMICUT_BURLEY) != 0, m.bright_lobe = (in.flags & LUMICUT_BRIGHT_LOBE) != 0;
  m.oren_nayar = (in.flags & LUMICUT_OREN_NAYAR) != 0, m.facets_once = (in.flags & LUMICUT_FACETS_ONCE) != 0;
  m.diffuse_roughness = in.diffuse_roughness, m.diffuse_once = (in.flags & LUMICUT_DIFFUSE_ONCE) != 0;
  m.shadows_pass = (in.flags & LUMICUT_SHADOWS_PASS) != 0, m.open_glass = (in.flags & LUMICUT_OPEN_GLASS) != 0;
  m.holdout = (in.flags & LUMICUT_HOLDOUT) != 0;
  m.bump_shadows = (in.flags & LUMICUT_BUMP_SHADOWS) != 0;
  c.range("specular_tint", in.specular_tint, 0.0f, 1.0f);
  if (max_component(vec(in.specular_tint)) > 0.0f) m.specular_tint = vec(in.specular_tint);
  c.not_negative("absorption", in.absorption);
  if ((in.flags & LUMICUT_OPEN_GLASS) != 0 && max_component(vec(in.absorption)) > 0.0f)
    c.fail("absorption", "must be 0 with LUMICUT_OPEN_GLASS, behind which shadow rays know no way out");
  m.absorption = vec(in.absorption);
  m.roughness = in.roughness, m.metallic = in.metallic, m.transmission = in.transmission;
  m.ior = in.ior == 0.0f ? 1.5f : in.ior;
  m.coat = in.coat, m.coat_roughness = in.coat_roughness;
  m.coat_ior = in.coat_ior == 0.0f ? 1.5f : in.coat_ior;
  m.opacity = in.opacity == 0.0f ? 1.0f : in.opacity;
  m.emission = vec(in.emission);
  m.emit_both_sides = (in.flags & LUMICUT_EMIT_BOTH_SIDES) != 0;
  m.diffuse_texture = texture_index(c, "diffuse_texture", in.diffuse_texture);
  m.specular_texture = texture_index(c, "specular_texture", in.specular_texture);
  m.normal_texture = texture_index(c, "normal_texture", in.normal_texture);
  c.range("normal_strength", in.normal_strength, 0.0f, 10.0f);
  m.normal_strength = in.normal_strength == 0.0f ? 1.0f : in.normal_strength;
  m.height_texture = texture_index(c, "height_texture", in.height_texture);
  c.range("bump_distance", in.bump_distance, -1e6f, 1e6f);
  m.bump_distance = in.bump_distance == 0.0f ? 1.0f : in.bump_distance;
  c.range("bump_strength", in.bump_strength, 0.0f, 10.0f);
  m.bump_strength = in.bump_strength == 0.0f ? 1.0f : in.bump_strength;
  m.roughness_texture = texture_index(c, "roughness_texture", in.roughness_texture);
  m.metallic_texture = texture_index(c, "metallic_texture", in.metallic_texture);
  m.diffuse_roughness_texture = texture_index(c, "diffuse_roughness_texture", in.diffuse_roughness_texture);
  m.opacity_texture = texture_index(c, "opacity_texture", in.opacity_texture);
  m.emission_texture = texture_index(c, "emission_texture", in.emission_texture);
  m.translucency = vec(in.translucency);
  m.translucency_texture = texture_index(c, "translucency_texture", in.translucency_texture);
  return m;
}

std::vector<Vec3f> to_normals(const float* xyz, uint64_t count) {
  std::vector<Vec3f> out;
  if (xyz == nullptr || count == 0) return out;
  out.resize(count);
  std::memcpy(static_cast<void*>(out.data()), xyz, count * sizeof(Vec3f));
  return out;
}

std::vector<Vec3f> to_positions(const float* xyz, uint64_t count, const char* owner) {
  std::vector<Vec3f> out = to_normals(xyz, count);
  const FieldValidator c(owner);
  for (uint64_t i = 0; i < out.size(); ++i)
    for (int k = 0; k < 3; ++k) c.coordinate("positions", out[i][k], static_cast<int64_t>(3 * i) + k);
  return out;
}

std::vector<Transform> to_transforms(const float* m, uint64_t count, const char* owner) {
  std::vector<Transform> out;
  if (m == nullptr) return out;
  out.resize(count);
  for (uint64_t i = 0; i < count; ++i)
    for (int k = 0; k < 12; ++k) {
      const float v = m[12 * i + k];
      FieldValidator(owner).finite("transforms", v, static_cast<int64_t>(12 * i) + k);
      out[i].m[k] = v;
    }
  return out;
}

Mesh to_mesh(const lumicut_mesh& in) {
  const FieldValidator c("lumicut_mesh");
  check_count(c, "vertex_count", in.vertex_count);
  check_count(c, "triangle_count", in.triangle_count);
  check_count(c, "transform_count", in.transform_count);
  c.integer("group", in.group, 0, kMaxGroup);
  if (in.vertex_count > 0 && in.positions == nullptr)
    c.fail("positions", "is NULL, but vertex_count is " + number_text(in.vertex_count));
  if (in.triangle_count > 0 && in.indices == nullptr)
    c.fail("indices", "is NULL, but triangle_count is " + number_text(in.triangle_count));
  if (in.transforms == nullptr && in.transform_count > 0)
    c.fail("transforms", "is NULL, but transform_count is " + number_text(in.transform_count));
  if (in.transforms != nullptr && in.transform_count == 0)
    c.fail("transform_count", "is 0, but transforms is not NULL");

  Mesh mesh;
  mesh.positions = to_positions(in.positions, in.vertex_count, "lumicut_mesh");
  mesh.normals = to_normals(in.normals, in.vertex_count);
  if (in.uvs != nullptr) {
    // What only shades is mended, not refused: real models carry broken uvs and normals.
    const auto mended = [](float v) { return std::isfinite(v) ? v : 0.0f; };
    mesh.uvs.resize(in.vertex_count);
    for (uint64_t i = 0; i < in.vertex_count; ++i) mesh.uvs[i] = {mended(in.uvs[2 * i]), mended(in.uvs[2 * i + 1])};
  }
  if (in.triangle_count > 0) mesh.indices.assign(in.indices, in.indices + 3 * in.triangle_count);
  for (size_t i = 0; i < mesh.indices.size(); ++i)
    if (mesh.indices[i] >= in.vertex_count)
      c.fail("indices",
             number_text(uint64_t{mesh.indices[i]}) + " is not below vertex_count " + number_text(in.vertex_count),
             static_cast<int64_t>(i));
  if (in.materials != nullptr && in.triangle_count > 0)
    mesh.triangle_materials.assign(in.materials, in.materials + in.triangle_count);
  mesh.attributes = to_attributes(in);
  mesh.instances = to_transforms(in.transforms, in.transform_count, "lumicut_mesh");
  mesh.material = in.material;
  mesh.mask = in.mask == 0 ? 0xffffffffu : in.mask;
  mesh.group = in.group;
  mesh.not_lit_by = in.not_lit_by, mesh.not_blocking = in.not_blocking;
  if (in.not_blocking >> kBlockerSets != 0)
    c.fail("not_blocking",
           number_text(uint64_t{in.not_blocking}) + " names sets beyond " + number_text(uint64_t{kBlockerSets}));
  c.integer("receivers", in.receivers, 0, kReceiverSets);
  c.integer("blockers", in.blockers, 0, kBlockerSets);
  mesh.receivers = in.receivers, mesh.blockers = in.blockers;
  return mesh;
}

ProfileRef to_profile(const lumicut_profile& in, uint64_t index) {
  const FieldValidator c("lumicut_profile", index);
  c.integer("vertical_count", in.vertical_count, 2, 65536);
  c.integer("horizontal_count", in.horizontal_count, 1, 65536);
  if (in.reserved != 0) c.fail_unknown("reserved", number_text(uint64_t{in.reserved}) + " is not 0");
  const auto copied = [&](const char* name, const float* values, size_t count) {
    if (values == nullptr) c.fail(name, "is NULL");
    return std::vector<float>(values, values + count);
  };
  try {
    return shared_profile({copied("vertical", in.vertical, in.vertical_count),
                           copied("horizontal", in.horizontal, in.horizontal_count),
                           copied("values", in.values, size_t{in.vertical_count} * in.horizontal_count)});
  } catch (const Error& error) {
    const std::string text = error.what();
    if (text.rfind("lumicut_profile", 0) == 0) throw;
    throw Error(error.code(), "lumicut_profile[" + number_text(index) + "]: " + text);
  }
}

// Whether a sphere is so small that its radiance, or one over its area, is beyond single precision, with what lamps are
// multiplied by in the end.
bool is_point(const Light& light) {
  constexpr double kRoom = 1e8;
  const double area = kPi * double{light.radius} * double{light.radius};
  return std::max(1.0, double{max_component(light.value)}) * kRoom > area * std::numeric_limits<float>::max();
}

Light to_light(const lumicut_light& in, uint64_t index, const std::vector<ProfileRef>& profiles) {
  const FieldValidator c("lumicut_light", index);
  c.integer("type", in.type, LUMICUT_POINT, LUMICUT_SUN);
  c.integer("unit", in.unit, LUMICUT_RADIOMETRIC, LUMICUT_WATT);
  c.integer("group", in.group, 0, kMaxGroup);
  c.not_negative("color", in.color);
  c.not_negative("value", in.value);
  const bool sun = in.type == LUMICUT_SUN, spot = in.type == LUMICUT_SPOT, point = in.type == LUMICUT_POINT;
  const bool area = in.type == LUMICUT_RECTANGLE || in.type == LUMICUT_DISK;

  Light light;
  light.type = static_cast<LightType>(in.type);
  light.group = in.group;
  if (!sun) {
    c.coordinate("position", in.position);
    light.position = vec(in.position);
  }
  if (point || spot) c.range("radius", in.radius, 0.0f, kLargestCoordinate);
  if (sun) c.range("radius", in.radius, 0.0f, 0.5f * kPi);
  if (!area) light.radius = in.radius;
  c.flags("flags", in.flags, LUMICUT_FACING_DISK | LUMICUT_NO_SHADOWS);
  light.facing = (in.flags & LUMICUT_FACING_DISK) != 0, light.shadows = (in.flags & LUMICUT_NO_SHADOWS) == 0;
  if (light.facing && !point && !spot)
    c.fail("flags", std::string("LUMICUT_FACING_DISK is not for a ") + type_name(in.type));
  if (light.facing && !(in.radius > 0.0f)) c.fail("radius", "must be above 0 with LUMICUT_FACING_DISK");
  c.flags("mask", in.mask, kAllRays);
  if (in.mask != 0) light.reach.seen_by = in.mask & ~uint32_t{kShadowRay};
  c.integer("receivers", in.receivers, 0, kReceiverSets);
  c.integer("blockers", in.blockers, 0, kBlockerSets);
  light.reach.receivers = in.receivers, light.reach.blockers = in.blockers;
  if (spot || sun) light.direction = c.direction("direction", in.direction);
  if (spot) {
    c.range("angle", in.angle, kMinAngle, kPi + 1e-5f);
    c.range("blend", in.blend, 0.0f, 1.0f);
    c.integer("spot_cosine", in.spot_cosine, 0, 1);
    const double half = 0.5 * in.angle;
    light.cos_outer = static_cast<float>(std::cos(half));
    // 1 − cos h = 2 sin²(h/2) without the cancellation.
    light.blend_cosine = static_cast<float>(2.0 * std::sin(0.5 * half) * std::sin(0.5 * half) * in.blend);
    light.spot_cosine = in.spot_cosine != 0;
  }

  double scale = in.value;  // of `color`, radiometric
  if (in.profile != 0) {
    if (!point) c.fail("profile", std::string("a ") + type_name(in.type) + " has none; point lamps do");
    if (in.profile > profiles.size())
      c.fail("profile", number_text(uint64_t{in.profile}) + " is out of range: the scene has " +
                            number_text(uint64_t{profiles.size()}) + " profiles");
    light.profile = profiles[in.profile - 1]->id();
    scale *= profiles[in.profile - 1]->largest();
    light.direction = c.direction("direction", in.direction);
    c.finite("tangent", in.tangent);
    const Vec3f given = vec(in.tangent);
    const Vec3f across = given - light.direction * dot(given, light.direction);
    if (given != Vec3f{} && !(length2(across) > 1e-10f * length2(given))) c.fail("tangent", "is parallel to direction");
    light.tangent = given != Vec3f{} ? normalize(across) : Frame(light.direction).t;
  }
  if (in.texture != 0 && !area) c.fail("texture", std::string("a ") + type_name(in.type) + " has none");
  if (area) {
    c.coordinate("u", in.u);
    c.coordinate("v", in.v);
    const Vec3d u = vec_double(in.u), v = vec_double(in.v);
    const double box = length(cross(u, v));
    if (!(box > std::numeric_limits<float>::min()))
      c.fail("u", std::string("with v spans no area; a ") + type_name(in.type) + " needs two edges");
    if (edge_cosine(u, v) > 1e-3) c.fail("u", "is not orthogonal to v (cosine " + number_text(edge_cosine(u, v)) + ")");
    light.u = vec(in.u), light.v = vec(in.v);
    light.spread = in.spread == 0.0f ? kPi : in.spread;
    c.range("spread", light.spread, kMinAngle, kPi + 1e-5f);
    light.spread = std::min(light.spread, kPi);
    light.texture = texture_index(c, "texture", in.texture);
    if (in.unit == LUMICUT_WATT) scale /= 4.0 * box * (in.type == LUMICUT_DISK ? 0.25 * std::numbers::pi : 1.0);
  } else if (in.unit == LUMICUT_WATT && !sun) {
    scale /= 4.0 * std::numbers::pi;
  }
  for (int k = 0; k < 3; ++k) {
    const double value = scale * in.color[k];
    if (value > std::numeric_limits<float>::max())
      c.fail("value", number_text(in.value) + " times color gives " + number_text(value) + ", beyond single precision");
    light.value[k] = static_cast<float>(value);
  }
  if (point && is_point(light)) light.radius = 0.0f;
  return light;
}

Environment to_environment(const lumicut_environment& in) {
  const FieldValidator c("lumicut_environment");
  c.integer("group", in.group, 0, kMaxGroup);
  c.not_negative("color", in.color);
  c.flags("flags", in.flags, LUMICUT_HIDDEN);
  Environment e;
  e.group = in.group;
  e.hidden = (in.flags & LUMICUT_HIDDEN) != 0;
  c.flags("mask", in.mask, kAllRays);
  if (in.mask != 0) e.reach.seen_by = in.mask & (kDiffuseRay | kGlossyRay | kTransmissionRay);
  e.color = vec(in.color);
  e.texture = texture_index(c, "texture", in.texture);
  bool given = false;
  for (int k = 0; k < 9; ++k) {
    c.finite("world_to_map", in.world_to_map[k], k);
    given = given || in.world_to_map[k] != 0.0f;
  }
  if (!given) return e;
  for (int row = 0; row < 3; ++row)
    for (int other = row; other < 3; ++other) {
      double d = 0;
      for (int k = 0; k < 3; ++k) d += double{in.world_to_map[3 * row + k]} * in.world_to_map[3 * other + k];
      if (std::abs(d - (row == other ? 1.0 : 0.0)) > 1e-3)
        c.fail("world_to_map", "is no rotation: rows " + number_text(int64_t{row}) + " and " +
                                   number_text(int64_t{other}) + " have the dot product " + number_text(d));
    }
  std::copy(std::begin(in.world_to_map), std::end(in.world_to_map), e.world_to_map);
  return e;
}

namespace {

void read_panorama(const FieldValidator& c, const lumicut_camera& in, Camera& camera) {
  camera.panorama = static_cast<Camera::Panorama>(in.panorama);
  if (in.lens_radius != 0.0f)
    c.fail("lens_radius", number_text(in.lens_radius) + " is not 0, but panorama is not either");
  if (in.panorama == LUMICUT_EQUIRECTANGULAR) {
    const bool whole = in.longitude[0] == 0 && in.longitude[1] == 0 && in.latitude[0] == 0 && in.latitude[1] == 0;
    if (whole) return;
    for (int k = 0; k < 2; ++k) {
      c.range("longitude", in.longitude[k], -kPi - 1e-5f, kPi + 1e-5f, k);
      c.range("latitude", in.latitude[k], -0.5f * kPi - 1e-5f, 0.5f * kPi + 1e-5f, k);
      camera.longitude[k] = in.longitude[k], camera.latitude[k] = in.latitude[k];
    }
    return;
  }
  if (in.panorama == LUMICUT_MIRROR_BALL || in.panorama == LUMICUT_EQUIANGULAR_CUBE) return;
  c.range("fisheye_fov", in.fisheye_fov, kMinAngle, 2.0f * kPi + 1e-5f);
  camera.fisheye_fov = in.fisheye_fov;
  if (in.panorama == LUMICUT_FISHEYE_EQUIDISTANT) return;
  c.range("fisheye_lens", in.fisheye_lens, std::numeric_limits<float>::min(), kLargestCoordinate);
  for (int k = 0; k < 2; ++k) c.range("sensor", in.sensor[k], std::numeric_limits<float>::min(), kLargestCoordinate, k);
  camera.fisheye_lens = in.fisheye_lens, camera.sensor_width = in.sensor[0], camera.sensor_height = in.sensor[1];
}

}  // namespace

Camera to_camera(const lumicut_camera& in) {
  const FieldValidator c("lumicut_camera");
  c.integer("orthographic", in.orthographic, 0, 1);
  c.integer("panorama", in.panorama, 0, LUMICUT_EQUIANGULAR_CUBE);
  if (in.orthographic != 0 && in.panorama != 0) c.fail("panorama", "is not 0, but orthographic is not either");
  for (int k = 0; k < 12; ++k) c.finite("to_world", in.to_world[k], k);
  for (const int k : {3, 7, 11}) c.coordinate("to_world", in.to_world[k], k);
  const auto column = [&](int k) { return Vec3d{in.to_world[k], in.to_world[4 + k], in.to_world[8 + k]}; };
  const Vec3d x = column(0), y = column(1), z = column(2);
  for (int k = 0; k < 3; ++k)
    if (!(length(column(k)) > 0.0)) c.fail("to_world", "column " + number_text(int64_t{k}) + " is 0");
  const double shear = std::max(edge_cosine(x, y), std::max(edge_cosine(y, z), edge_cosine(z, x)));
  if (shear > 1e-3) c.fail("to_world", "axes are not orthogonal (cosine " + number_text(shear) + ")");

  Camera camera;
  camera.orthographic = in.orthographic != 0;
  const auto single = [](const Vec3d& v) {
    return Vec3f{static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
  };
  const Vec3d back = normalize(z), right = normalize(x - back * dot(x, back));
  const Vec3d up = normalize(y - back * dot(y, back) - right * dot(y, right));
  camera.forward = single(-back), camera.right = single(right), camera.up = single(up);
  camera.position = single(column(3));
  if (camera.orthographic) {
    c.range("height", in.height, std::numeric_limits<float>::min(), kLargestCoordinate);
    camera.height = in.height;
  } else if (in.panorama != 0) {
    read_panorama(c, in, camera);
  } else {
    c.range("fov_y", in.fov_y, 1e-4f, kPi - 1e-4f);
    camera.tan_half_fov_y = static_cast<float>(std::tan(0.5 * in.fov_y));
  }
  c.finite("shift", in.shift[0], 0);
  c.finite("shift", in.shift[1], 1);
  camera.shift_x = in.shift[0], camera.shift_y = in.shift[1];
  c.not_negative("near_clip", in.near_clip);
  camera.near_clip = in.near_clip;
  if (in.far_clip != 0.0f) {
    if (!(in.far_clip > in.near_clip))
      c.fail("far_clip", number_text(in.far_clip) + " is not beyond near_clip " + number_text(in.near_clip));
    camera.far_clip = in.far_clip;
  }
  if (in.pixel_aspect != 0.0f) {
    c.range("pixel_aspect", in.pixel_aspect, 1e-3f, 1e3f);
    camera.pixel_aspect = in.pixel_aspect;
  }
  c.range("lens_radius", in.lens_radius, 0.0f, kLargestCoordinate);
  camera.lens_radius = in.lens_radius;
  if (in.lens_radius > 0.0f) {
    c.range("focus_distance", in.focus_distance, std::numeric_limits<float>::min(), kInf);
    camera.focus_distance = in.focus_distance;
  }
  return camera;
}

// A virtual light begins as the host's struct does.
static_assert(offsetof(lumicut_vpl, normal) == offsetof(Vpl, normal) &&
              offsetof(lumicut_vpl, intensity) == offsetof(Vpl, intensity) &&
              offsetof(lumicut_vpl, spread_tan) == offsetof(Vpl, spread_tan) &&
              offsetof(lumicut_vpl, profile) == offsetof(Vpl, profile) &&
              sizeof(lumicut_vpl) == offsetof(Vpl, profile) + sizeof(uint32_t) && std::is_trivially_copyable_v<Vpl>);

namespace {

// Profiles that it names are added to `profiles`.
Vpl to_vpl(const lumicut_vpl& in, uint64_t i, const LightProfiles& known, LightProfiles& profiles) {
  const FieldValidator c("lumicut_vpl", i);
  c.integer("kind", in.kind, LUMICUT_VPL_OMNI, LUMICUT_VPL_SPHERE);
  c.integer("group", in.group, 0, kMaxGroup);
  c.not_negative("intensity", in.intensity);
  if (in.profile != 0 && in.kind != LUMICUT_VPL_SPOT) c.fail("profile", "only spots have one");
  if (in.profile != 0 && profiles.find(in.profile) == nullptr) {
    const ProfileRef named = known.find(in.profile) != nullptr ? known.hold(in.profile) : named_profile(in.profile);
    if (named == nullptr)
      c.fail("profile", number_text(uint64_t{in.profile}) + " is no profile that a scene was given");
    profiles.add(named);
  }
  Vpl vpl;
  vpl.kind = static_cast<VplKind>(in.kind);
  vpl.group = in.group;
  vpl.intensity = vec(in.intensity);
  if (vpl.kind != VplKind::directional) {
    c.coordinate("position", in.position);
    vpl.position = vec(in.position);
  }
  if (vpl.kind != VplKind::omni) {
    c.finite("normal", in.normal);
    const double l = length(vec_double(in.normal));
    if (std::abs(l - 1.0) > 1e-2) c.fail("normal", "has length " + number_text(l) + ", not 1");
    // Those that are unit as far as floats go stay as they are, so that a set goes out and in again unchanged.
    vpl.normal = std::abs(l - 1.0) > 1e-6 ? vec(in.normal) * static_cast<float>(1.0 / l) : vec(in.normal);
  }
  if (in.profile != 0) {
    c.range("cos_outer", in.cos_outer, -1.0f, 1.0f);
    const float tangent[3] = {in.blend, in.spot_cosine, in.spread_tan};
    c.finite("blend", tangent);
    if (std::abs(length(vec_double(tangent)) - 1.0) > 1e-2 || std::abs(dot(vec(tangent), vpl.normal)) > 1e-2f)
      c.fail("blend", "with spot_cosine and spread_tan is no unit vector orthogonal to the normal");
    vpl.cos_outer() = in.cos_outer, vpl.profile = in.profile;
    vpl.blend_cosine = in.blend, vpl.spot_cosine = in.spot_cosine, vpl.spread_tan = in.spread_tan;
  } else if (vpl.kind == VplKind::sphere) {
    c.range("cos_outer", in.cos_outer, std::numeric_limits<float>::min(), kLargestCoordinate);
    vpl.radius() = in.cos_outer;
  } else if (vpl.kind == VplKind::spot) {
    c.range("cos_outer", in.cos_outer, -1.0f, 1.0f);
    c.range("blend", in.blend, 0.0f, 2.0f);
    c.range("spot_cosine", in.spot_cosine, 0.0f, 1.0f);
    c.not_negative("spread_tan", in.spread_tan);
    vpl.cos_outer() = in.cos_outer, vpl.blend_cosine = in.blend, vpl.spot_cosine = in.spot_cosine;
    vpl.spread_tan = in.spread_tan;
  }
  return vpl;
}

void check_unit(const FieldValidator& c, const char* name, const float (&v)[3]) {
  c.finite(name, v);
  const double l = length(vec_double(v));
  if (std::abs(l - 1.0) > 1e-2) c.fail(name, "has length " + number_text(l) + ", not 1");
}

void take_origin(const lumicut_vpl_origin& in, uint64_t i, Vpl& vpl) {
  const FieldValidator c("lumicut_vpl_origin", i);
  c.integer("source", in.source, LUMICUT_SOURCE_PATH, LUMICUT_SOURCE_AREA);
  c.range("offset", in.offset, 0.0f, kLargestCoordinate);
  c.not_negative("area", in.area);
  if (in.source == LUMICUT_SOURCE_AREA && !(in.area > 0.0f))
    c.fail("area", "is 0, but the source is LUMICUT_SOURCE_AREA");
  if (in.source != LUMICUT_SOURCE_AREA && in.area > 0.0f)
    c.fail("area", number_text(in.area) + " is not 0, but the source is not LUMICUT_SOURCE_AREA");
  vpl.offset = in.offset, vpl.cell = in.area;
}

void give_lobe(const DiffuseLobe& lobe, lumicut_vpl_origin& out) {
  if (!lobe.any()) return;
  for (int k = 0; k < 3; ++k) out.mirror[k] = lobe.mirror[k];
  out.slope = lobe.slope, out.again = lobe.again, out.retro = lobe.retro, out.dim = lobe.dim,
  out.falloff = lobe.falloff;
  out.lobe_mean = lobe.mean;
}

DiffuseLobe take_lobe(const lumicut_vpl_origin& in, uint64_t i, const Vpl& vpl) {
  const FieldValidator c("lumicut_vpl_origin", i);
  c.range("slope", in.slope, 0.0f, 1.0f);
  c.range("again", in.again, 0.0f, 1.0f);
  c.range("retro", in.retro, 0.0f, 2.0f);
  c.range("dim", in.dim, 0.0f, 0.5f);
  c.range("falloff", in.falloff, 0.0f, 1.0f);
  DiffuseLobe lobe{{}, in.slope, in.again, in.retro, in.dim, in.falloff, in.lobe_mean};
  if (!lobe.any()) return {};
  if (in.source != LUMICUT_SOURCE_PATH || vpl.kind != VplKind::oriented)
    c.fail("slope", "with retro, dim and falloff is a lobe, but the light is no oriented one of LUMICUT_SOURCE_PATH");
  check_unit(c, "mirror", in.mirror);
  c.range("lobe_mean", in.lobe_mean, 0.01f, 100.0f);
  lobe.mirror = vec(in.mirror);
  return lobe;
}

}  // namespace

lumicut_vpl_set HostVpls::view() const {
  return {sizeof(lumicut_vpl_set), 0, lights.size(), lights.data(), origins.data(), light_paths, emitter_samples};
}

HostVpls from_vpls(const VplSet& set) {
  HostVpls out;
  out.lights.resize(set.lights.size());
  out.origins.resize(set.lights.size());
  for (size_t i = 0; i < set.lights.size(); ++i) {
    const Vpl& v = set.lights[i];
    std::memcpy(&out.lights[i], &v, sizeof(lumicut_vpl));
    const bool area = v.cell > 0.0f;
    out.origins[i].source = i >= set.direct ? LUMICUT_SOURCE_PATH : area ? LUMICUT_SOURCE_AREA : LUMICUT_SOURCE_POINT;
    out.origins[i].offset = v.offset, out.origins[i].area = v.cell;
    const bool lobed = v.kind == VplKind::oriented && i >= set.direct && i - set.direct < set.lobes.size();
    if (lobed) give_lobe(set.lobes[i - set.direct], out.origins[i]);
  }
  out.light_paths = set.light_paths, out.emitter_samples = set.extended;
  return out;
}

VplSet to_vpls(const lumicut_vpl_set& in, const LightProfiles& known) {
  const FieldValidator c("lumicut_vpl_set");
  if (in.reserved != 0) c.fail_unknown("reserved", number_text(uint64_t{in.reserved}) + " is not 0");
  VplSet set;
  if (in.count > 0 && in.lights == nullptr) fail_argument("lumicut_vpls: NULL, but count is " + number_text(in.count));
  if (in.count > 0xfffffffeu)
    fail_argument("lumicut_vpls: count " + number_text(in.count) + " is more than 4294967294");
  const auto direct = [&](uint64_t i) { return in.origins != nullptr && in.origins[i].source != LUMICUT_SOURCE_PATH; };
  uint64_t areas = 0;
  set.lights.reserve(in.count);
  for (const bool first : {true, false}) {
    for (uint64_t i = 0; i < in.count; ++i) {
      if (direct(i) != first) continue;
      set.lights.push_back(to_vpl(in.lights[i], i, known, set.profiles));
      if (in.origins == nullptr) continue;
      take_origin(in.origins[i], i, set.lights.back());
      const DiffuseLobe lobe = take_lobe(in.origins[i], i, set.lights.back());
      if (!first) set.lobes.push_back(lobe);
      if (in.origins[i].source == LUMICUT_SOURCE_AREA) ++areas;
    }
    if (first) set.direct = set.lights.size();
  }
  if (in.count > 0 && in.origins == nullptr && in.emitter_samples != 0)
    c.fail("emitter_samples", "is " + number_text(in.emitter_samples) + ", but origins is NULL");
  if (in.emitter_samples < areas)
    c.fail("emitter_samples", number_text(in.emitter_samples) + " is less than the " + number_text(areas) +
                                  " lights of LUMICUT_SOURCE_AREA");
  // Where origins are known, so is that lights of one path follow each other, however many paths there were.
  set.light_paths = in.origins != nullptr ? std::max<uint64_t>(1, in.light_paths) : 0;
  set.extended = in.emitter_samples;
  if (std::none_of(set.lobes.begin(), set.lobes.end(), [](const DiffuseLobe& lobe) { return lobe.any(); }))
    set.lobes.clear();
  return set;
}

void check_points(const Scene& scene, const lumicut_point* points, uint64_t count) {
  if (count > 0 && points == nullptr) fail_argument("lumicut_points: NULL, but count is " + number_text(count));
  const size_t materials = scene.materials().size();
  parallel_chunks(count, 16384, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i) {
      const FieldValidator c("lumicut_point", i);
      const lumicut_point& p = points[i];
      c.coordinate("position", p.position);
      check_unit(c, "normal", p.normal);
      check_unit(c, "geometric_normal", p.geometric_normal);
      check_unit(c, "to_viewer", p.to_viewer);
      c.finite("u", p.u);
      c.finite("v", p.v);
      if (p.material >= materials)
        c.fail("material", number_text(uint64_t{p.material}) + " is out of range: the scene has " +
                               number_text(uint64_t{materials}) + " materials");
    }
  });
}

std::vector<uint64_t> append_points(const Scene& scene, const lumicut_point* points, uint64_t first, uint64_t last,
                                    ShadePoints& out) {
  std::vector<uint64_t> starts;
  for (uint64_t i = first; i < last; ++i) {
    const lumicut_point& p = points[i];
    const Vec3f position = vec(p.position), geometric = normalize(vec(p.geometric_normal)),
                normal = normalize(vec(p.normal)), to_viewer = normalize(vec(p.to_viewer));
    if (scene.most_layers() > 1) starts.push_back(out.size());
    const Bsdf bsdf = scene.bsdf({position, geometric, normal, to_viewer, scene.offset_at(position), p.pixel},
                                 p.material, {p.u, p.v});
    for (const SurfacePoint& point : bsdf.layers()) out.push(point);
  }
  return starts;
}

static PixelFilter to_filter(const FieldValidator& c, const lumicut_render_desc& in) {
  c.integer("filter", in.filter, LUMICUT_BOX, LUMICUT_BLACKMAN_HARRIS);
  PixelFilter filter;
  filter.kind = static_cast<PixelFilter::Kind>(in.filter);
  if (filter.kind != PixelFilter::Kind::box) filter.width = 1.5f;
  if (in.filter_width == 0.0f) return filter;
  const bool box = filter.kind == PixelFilter::Kind::box;
  c.range("filter_width", in.filter_width, box ? 1.0f : 0.01f, box ? 1.0f : 10.0f);
  filter.width = in.filter_width;
  return filter;
}

Rect part_of(const Rect& crop, const lumicut_tile* rect) {
  Rect part = crop;
  if (rect != nullptr) {
    const lumicut_tile in = read(rect);
    part = {in.x0, in.y0, in.x1, in.y1};
  }
  if (part.x0 >= part.x1 || part.y0 >= part.y1 || part.x0 < crop.x0 || part.y0 < crop.y0 || part.x1 > crop.x1 ||
      part.y1 > crop.y1)
    fail_argument("lumicut_tile: (" + number_text(uint64_t{part.x0}) + ", " + number_text(uint64_t{part.y0}) + ", " +
                  number_text(uint64_t{part.x1}) + ", " + number_text(uint64_t{part.y1}) +
                  ") is not a rectangle inside the crop");
  return part;
}

FrameOptions to_frame_options(const lumicut_render_desc& in) {
  const FieldValidator c("lumicut_render_desc");
  c.integer("width", in.width, 1, 65536);
  c.integer("height", in.height, 1, 65536);
  c.integer("samples", in.samples, 0, 65536);
  if (in.tile_size != 0) c.integer("tile_size", in.tile_size, 8, 65536);
  FrameOptions o;
  o.width = in.width, o.height = in.height;
  o.samples = in.samples == 0 ? 1 : in.samples;
  o.illuminance = (in.flags & LUMICUT_ILLUMINANCE) != 0;
  o.denoise = (in.flags & LUMICUT_DENOISE) != 0;
  o.filter = to_filter(c, in);
  c.flags("lobes", in.lobes, kDiffuseRay | kGlossyRay | kTransmissionRay);
  c.range("occlusion", in.occlusion, 0.0f, kLargestCoordinate);
  o.lobes = in.lobes, o.direct = (in.flags & LUMICUT_DIRECT) != 0, o.occlusion = in.occlusion;
  // A batch holds at least a tile's samples: tiles shrink rather than let memory grow with the samples.
  const auto tile_points = [&] { return uint64_t{o.tile_size} * o.tile_size * o.samples; };
  o.tile_size = in.tile_size == 0 ? 64 : in.tile_size;
  while (in.tile_size == 0 && o.tile_size > 8 && tile_points() > 1u << 20) o.tile_size /= 2;
  if (in.tile_size != 0 && tile_points() > 1u << 24)
    c.fail("tile_size", number_text(uint64_t{in.tile_size}) + " with " + number_text(uint64_t{o.samples}) +
                            " samples is more than 2^24 samples a tile");
  o.crop = {in.crop[0], in.crop[1], in.crop[2], in.crop[3]};
  if (o.crop == Rect{}) o.crop = {0, 0, in.width, in.height};
  if (o.crop.x0 >= o.crop.x1 || o.crop.y0 >= o.crop.y1 || o.crop.x1 > in.width || o.crop.y1 > in.height) {
    std::string text = "(";
    for (int k = 0; k < 4; ++k) text += number_text(uint64_t{in.crop[k]}) + (k < 3 ? ", " : ")");
    c.fail("crop", text + " is not a rectangle x0, y0, x1, y1 inside " + number_text(uint64_t{in.width}) + " x " +
                       number_text(uint64_t{in.height}));
  }
  return o;
}

// More than the state of the largest image that hosts can ask for in the memory of any machine.
constexpr uint64_t kMostCheckpointBytes = (uint64_t{1} << 40) - 1;

IterationOptions to_pass_options(const lumicut_render_desc& in) {
  const FieldValidator c("lumicut_render_desc");
  c.not_negative("max_seconds", in.max_seconds);
  c.range("target_error", in.target_error, 0.0f, 1e6f);
  c.range("confidence", in.confidence, 0.0f, 0.999999f);
  c.flags("flags", in.flags,
          LUMICUT_CHECKPOINTS | LUMICUT_ILLUMINANCE | LUMICUT_GROUPS | LUMICUT_DENOISE | LUMICUT_KEEP_FIREFLIES |
              LUMICUT_DIRECT);
  if (in.checkpoint != nullptr && in.checkpoint_size == 0) c.fail("checkpoint_size", "0 bytes are no checkpoint");
  c.integer("checkpoint_size", in.checkpoint_size, 0, kMostCheckpointBytes);
  if (in.checkpoint == nullptr && in.checkpoint_size != 0)
    c.fail("checkpoint", "is NULL, but checkpoint_size is " + number_text(in.checkpoint_size));
  IterationOptions o;
  o.max_seconds = in.max_seconds, o.target_error = in.target_error;
  o.confidence = in.confidence > 0.0f ? in.confidence : 0.95;
  o.count = in.passes > 0 ? in.passes : (in.max_seconds > 0.0f || in.target_error > 0.0f ? 0 : 1);
  o.groups = (in.flags & LUMICUT_GROUPS) != 0;
  o.checkpoints = (in.flags & LUMICUT_CHECKPOINTS) != 0;
  o.keep_fireflies = (in.flags & LUMICUT_KEEP_FIREFLIES) != 0;
  if (in.checkpoint != nullptr) {
    const auto* bytes = static_cast<const uint8_t*>(in.checkpoint);
    o.resume.assign(bytes, bytes + in.checkpoint_size);
  }
  return o;
}

void check_render_bytes(const Rect& crop, uint64_t bytes) {
  const double memory = static_cast<double>(sysconf(_SC_PHYS_PAGES)) * static_cast<double>(sysconf(_SC_PAGESIZE));
  if (memory > 0 && static_cast<double>(bytes) > memory)
    throw Error(ErrorCode::out_of_memory, "lumicut_render_desc: a render of " + number_text(uint64_t{crop.width()}) +
                                              " x " + number_text(uint64_t{crop.height()}) + " pixels needs " +
                                              number_text(std::round(static_cast<double>(bytes) / 1e9)) +
                                              " GB, more than the machine has");
}

}  // namespace lumicut
