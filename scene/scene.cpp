#include "scene/scene.h"

#include "accel/validate.h"
#include "bsdf/straight_glass.h"
#include "core/error.h"
#include "core/rng.h"
#include "core/short_text.h"

namespace lumicut {

namespace {

// Some 16 units in the last place of the largest coordinate that the place of a hit is computed from.
constexpr float kOffset = 2e-6f;
constexpr size_t kMostExtentBoxes = 65536;

float largest_coordinate(const Vec3f& p) { return max_component(max(p, -p)); }

// Largest number that a point passes through on its way to the world.
float largest_term(const Transform& t, const Vec3f& p) {
  float largest = 0.0f;
  for (int row = 0; row < 3; ++row) {
    const float* m = &t.m[4 * row];
    largest = std::max({largest, std::abs(m[0] * p.x), std::abs(m[1] * p.y), std::abs(m[2] * p.z), std::abs(m[3])});
  }
  return largest;
}

constexpr float kInvPi = 0.31830988618f;
// A viewer that sees about the mean of what depends on the view.
Vec3f mean_view(const Vec3f& normal) { return normal * (2.0f / 3.0f) + Frame(normal).t * 0.745356f; }
// Over which the slope of a program's bumps is taken at least, in offsets of a hit: far above the precision of places.
constexpr float kLeastBumpStep = 50.0f;

// A turned normal that does not lie below the surface itself.
Vec3f above_surface(Vec3f n, const SurfaceHit& hit) {
  constexpr float kLeast = 0.02f;
  if (const float up = dot(n, hit.geometric_normal); up < kLeast)
    n = normalize(n + hit.geometric_normal * (kLeast - up));
  return n == Vec3f{} ? hit.normal : n;
}

std::string at(const char* what, size_t i) { return std::string(what) + "[" + std::to_string(i) + "]"; }

void check_finite(const std::vector<Vec3f>& values, const char* what) {
  for (size_t i = 0; i < values.size(); ++i)
    if (!is_finite(values[i])) fail_argument(at(what, i) + " is not finite");
}

void check_transforms(const std::vector<Transform>& transforms) {
  for (size_t i = 0; i < transforms.size(); ++i)
    for (float m : transforms[i].m)
      if (!std::isfinite(m)) fail_argument(at("mesh transform", i) + " is not finite");
}

void check_mesh(const Mesh& mesh) {
  const size_t n = mesh.positions.size();
  if (mesh.indices.size() % 3 != 0)
    fail_argument("mesh has " + std::to_string(mesh.indices.size()) + " indices, not a multiple of 3");
  if (n >= kNoId || mesh.triangle_count() >= kNoId) fail_argument("mesh has more than 2^32-2 vertices or triangles");
  if (!mesh.normals.empty() && mesh.normals.size() != n)
    fail_argument("mesh has " + std::to_string(mesh.normals.size()) + " normals for " + std::to_string(n) +
                  " vertices");
  if (!mesh.uvs.empty() && mesh.uvs.size() != n)
    fail_argument("mesh has " + std::to_string(mesh.uvs.size()) + " uvs for " + std::to_string(n) + " vertices");
  if (!mesh.triangle_materials.empty() && mesh.triangle_materials.size() != mesh.triangle_count())
    fail_argument("mesh has " + std::to_string(mesh.triangle_materials.size()) + " triangle materials for " +
                  std::to_string(mesh.triangle_count()) + " triangles");
  for (size_t i = 0; i < mesh.attributes.size(); ++i) {
    const MeshAttribute& a = mesh.attributes[i];
    const size_t places = a.domain == AttributeDomain::vertex     ? n
                          : a.domain == AttributeDomain::triangle ? mesh.triangle_count()
                                                                  : std::max<size_t>(1, mesh.instances.size());
    if (a.values.size() != a.components * places)
      fail_argument(at("mesh attribute", i) + " has " + std::to_string(a.values.size()) + " values for " +
                    std::to_string(places) + " places of " + std::to_string(a.components) + " components");
    if (mesh.attribute(a.id) != &a)
      fail_argument(at("mesh attribute", i) + " has the id " + std::to_string(a.id) + " of an earlier one");
  }
  check_finite(mesh.positions, "mesh position");
  for (size_t i = 0; i < mesh.indices.size(); ++i)
    if (mesh.indices[i] >= n)
      fail_argument(at("mesh index", i) + " = " + std::to_string(mesh.indices[i]) + " is out of range: the mesh has " +
                    std::to_string(n) + " vertices");
  check_transforms(mesh.instances);
}

// Broken shading normals fall back to flat ones rather than spread NaN.
void mend_normals(std::vector<Vec3f>& normals) {
  for (Vec3f& n : normals)
    if (!is_finite(n)) n = {};
}

// 0 without coordinates.
Vec2f uv_at(const Mesh& mesh, uint32_t prim, float u, float v) {
  if (mesh.uvs.empty()) return {};
  const uint32_t* t = &mesh.indices[3 * size_t{prim}];
  const Vec2f a = mesh.uvs[t[0]], b = mesh.uvs[t[1]], c = mesh.uvs[t[2]];
  return {a.x + u * (b.x - a.x) + v * (c.x - a.x), a.y + u * (b.y - a.y) + v * (c.y - a.y)};
}

// Chance by the place, so that a ray fares the same whenever it is traced; on a grid, so that last bits of u and v,
// which differ between ways to trace, do not matter.
bool passes_by_chance(float stops, uint32_t mesh, uint32_t prim, float u, float v) {
  constexpr float kLeast = 1.0f / 256.0f, kCells = 1 << 20;
  if (stops < kLeast || stops > 1.0f - kLeast) return stops < kLeast;
  const auto cell = [](float x) { return static_cast<uint64_t>(std::clamp(x, 0.0f, 1.0f) * kCells); };
  const uint64_t place = hash64(hash64(mesh, prim), cell(u) << 32 | cell(v));
  return static_cast<float>(place >> 40) * 0x1p-24f >= stops;
}

Vec3f facing(const Vec3f& normal, const Vec3f& front) { return dot(front, normal) < 0.0f ? -normal : normal; }

// Which channel of colours a ray carries, by chance of its line (unit `dir`, on a grid as above): the same at all borders
// that it passes, where its chances are products of this channel's shares then, and their mean that of the colours' products.
int channel_of(const Vec3f& at, const Vec3f& dir, float extent) {
  const auto cell = [](float x, float scale) {
    return static_cast<uint64_t>(static_cast<int64_t>(std::floor(std::clamp(x * scale, -1e15f, 1e15f))));
  };
  const float side = dir.x + 2.0f * dir.y + 4.0f * dir.z < 0.0f ? -1.0f : 1.0f;  // the line's, not the ray's
  const Vec3f d = dir * side, moment = cross(at, d);
  const float fine = 16384.0f / std::max(extent, 1e-20f);
  uint64_t line = 0;
  for (int k = 0; k < 3; ++k) line = hash64(line, hash64(cell(d[k], 16384.0f), cell(moment[k], fine)));
  const float u = static_cast<float>(line >> 40) * 0x1p-24f;
  const float red = luminance({1, 0, 0}), green = luminance({0, 1, 0});
  return u < red ? 0 : u < red + green ? 1 : 2;
}

}  // namespace

void Scene::set_textures(std::vector<Texture> textures) {
  textures_ = std::move(textures);
  committed_ = false;
}
void Scene::set_materials(std::vector<Material> materials) {
  std::vector<std::shared_ptr<const GlassAlbedo>> glass(materials.size());
  const auto known = [&](float ior) {
    for (const auto* list : {&glass_, &glass})
      for (const auto& g : *list)
        if (g && g->ior() == ior) return g;
    return std::shared_ptr<const GlassAlbedo>();
  };
  size_t most_layers = 1;
  for (size_t i = 0; i < materials.size(); ++i) {
    const Material& m = materials[i];
    most_layers = std::max(most_layers, size_t{1} + (m.rough_coat() ? 1 : 0) + (m.translucent() ? 1 : 0));
    if (m.lobe != LobeModel::ggx || !(m.transmission > 0.0f) || !(m.roughness > 0.0f)) continue;
    glass[i] = known(m.ior);
    if (!glass[i]) glass[i] = std::make_shared<const GlassAlbedo>(m.ior);
  }
  glass_ = std::move(glass), most_layers_ = most_layers;
  materials_ = std::move(materials);
  committed_ = false;
}

namespace {

// Mean way through a closed mesh, 2·volume/area: a slab's thickness. By it and a slab's slant the mean over all directions
// is the mean chord of any convex body, 4·volume/area [Cauchy]. Of the faces that absorb alone; 0 where they are not closed: do not cancel.
float thickness_of(const Mesh& mesh, const std::vector<Material>& materials) {
  double volume = 0, area = 0;
  Vec3d sum{};
  for (size_t i = 0; i + 2 < mesh.indices.size(); i += 3) {
    if (!materials[mesh.material_of(static_cast<uint32_t>(i / 3))].absorbs_straight()) continue;
    const auto corner = [&](size_t k) {
      const Vec3f p = mesh.positions[mesh.indices[i + k]] - mesh.positions[mesh.indices[0]];
      return Vec3d{p.x, p.y, p.z};
    };
    const Vec3d a = corner(0), b = corner(1), c = corner(2), n = cross(b - a, c - a);
    volume += dot(a, n) / 6, area += length(n) / 2, sum += n * 0.5;
  }
  return length(sum) < 1e-3 * area ? static_cast<float>(2 * std::abs(volume) / area) : 0.0f;
}

}  // namespace

uint32_t Scene::add_mesh(Mesh mesh) {
  check_mesh(mesh);
  mend_normals(mesh.normals);
  meshes_.push_back(std::move(mesh));
  committed_ = false;
  return static_cast<uint32_t>(meshes_.size() - 1);
}

void Scene::update_mesh(uint32_t id, std::vector<Vec3f> positions, std::vector<Vec3f> normals,
                        std::vector<Transform> instances) {
  if (id >= meshes_.size())
    fail_argument("mesh id " + std::to_string(id) + " is out of range: the scene has " +
                  std::to_string(meshes_.size()));
  Mesh& mesh = meshes_[id];
  if (!positions.empty() && positions.size() != mesh.positions.size())
    fail_argument("update of mesh " + std::to_string(id) + " changes its vertex count");
  if (!normals.empty() && normals.size() != mesh.positions.size())
    fail_argument("update of mesh " + std::to_string(id) + " has a wrong count of normals");
  if (!instances.empty() && instances.size() != std::max<size_t>(1, mesh.instances.size()))
    fail_argument("update of mesh " + std::to_string(id) + " changes its count of transforms");
  check_finite(positions, "mesh position");
  check_transforms(instances);
  mend_normals(normals);
  if (!positions.empty()) mesh.positions = std::move(positions);
  if (!normals.empty()) mesh.normals = std::move(normals);
  if (!instances.empty()) mesh.instances = std::move(instances);
  committed_ = false;
}

void Scene::set_lights(std::vector<Light> lights, LightProfiles profiles) {
  lights_ = std::move(lights);
  profiles_ = std::move(profiles);
  committed_ = false;
}
void Scene::set_environment(const Environment& environment) {
  environment_ = environment;
  committed_ = false;
}
void Scene::set_camera(const Camera& camera) {
  camera_ = camera;
  has_camera_ = true;
  committed_ = false;
}
void Scene::set_trace(AccelFactory factory) {
  trace_ = std::move(factory);
  committed_ = false;
}

void Scene::check_references() const {
  const auto check_texture = [&](int32_t index, size_t material, const char* field, bool by_view = false,
                                 const char* owner = "material") {
    if (index >= 0 && static_cast<size_t>(index) >= textures_.size())
      fail_argument(at(owner, material) + "." + field + " = " + std::to_string(index) +
                    " is out of range: the scene has " + std::to_string(textures_.size()) + " textures");
    if (index < 0) return;
    if (const TextureProgram* program = textures_[index].program())
      return program->check_textures(textures_, at("texture", static_cast<size_t>(index)) + ".program: ");
    if (textures_[index].is_by_view() && !by_view)
      fail_argument(at(owner, material) + "." + field + " = " + std::to_string(index) +
                    " is a texture by view, which this field cannot have");
  };
  for (size_t i = 0; i < materials_.size(); ++i) {
    check_texture(materials_[i].diffuse_texture, i, "diffuse_texture", true);
    check_texture(materials_[i].specular_texture, i, "specular_texture", true);
    check_texture(materials_[i].opacity_texture, i, "opacity_texture");
    check_texture(materials_[i].emission_texture, i, "emission_texture");
    check_texture(materials_[i].translucency_texture, i, "translucency_texture", true);
    check_texture(materials_[i].normal_texture, i, "normal_texture");
    check_texture(materials_[i].height_texture, i, "height_texture");
    if (const int32_t heights = materials_[i].height_texture; heights >= 0 && textures_[heights].program() != nullptr)
      fail_argument(at("material", i) + ".height_texture = " + std::to_string(heights) +
                    " is a program; bumps of those belong into the program of normal_texture");
    if (const int32_t normals = materials_[i].normal_texture;
        normals >= 0 && textures_[normals].program() != nullptr && materials_[i].height_texture >= 0)
      fail_argument(at("material", i) + ".height_texture = " + std::to_string(materials_[i].height_texture) +
                    " stands beside a normal_texture that is a program");
    check_texture(materials_[i].roughness_texture, i, "roughness_texture", true);
    check_texture(materials_[i].metallic_texture, i, "metallic_texture", true);
    check_texture(materials_[i].diffuse_roughness_texture, i, "diffuse_roughness_texture", true);
  }
  for (size_t i = 0; i < lights_.size(); ++i)
    if (lights_[i].profile != 0 && profiles_.find(lights_[i].profile) == nullptr)
      fail_argument(at("light", i) + ".profile = " + std::to_string(lights_[i].profile) +
                    " is none of the scene's profiles");
  for (size_t i = 0; i < lights_.size(); ++i) {
    check_texture(lights_[i].texture, i, "texture", false, "light");
    if (lights_[i].texture >= 0 && textures_[lights_[i].texture].program() != nullptr)
      fail_argument(at("light", i) + ".texture = " + std::to_string(lights_[i].texture) +
                    " is a program, which surfaces alone can have");
  }
  if (environment_.texture >= 0 && static_cast<size_t>(environment_.texture) >= textures_.size())
    fail_argument("environment.texture = " + std::to_string(environment_.texture) + " is out of range: the scene has " +
                  std::to_string(textures_.size()) + " textures");
  if (environment_.texture >= 0 && textures_[environment_.texture].is_by_view())
    fail_argument("environment.texture = " + std::to_string(environment_.texture) + " is a texture by view");
  if (environment_.texture >= 0 && textures_[environment_.texture].program() != nullptr)
    fail_argument("environment.texture = " + std::to_string(environment_.texture) +
                  " is a program, which surfaces alone can have");
  for (size_t m = 0; m < meshes_.size(); ++m) {
    const auto check = [&](uint32_t material) {
      if (material >= materials_.size())
        fail_argument(at("mesh", m) + " material " + std::to_string(material) + " is out of range: the scene has " +
                      std::to_string(materials_.size()) + " materials");
    };
    if (meshes_[m].triangle_materials.empty() && meshes_[m].triangle_count() > 0) check(meshes_[m].material);
    for (uint32_t material : meshes_[m].triangle_materials) check(material);
  }
}

void Scene::commit(Progress& progress) {
  progress.begin("acceleration structure", 1);
  check_references();

  const bool instanced = std::any_of(meshes_.begin(), meshes_.end(), [](const Mesh& m) {
    return m.instances.size() > 1 || (m.instances.size() == 1 && m.instances[0] != Transform{});
  });
  AccelGeometry geometry;
  geometry.filter = this;
  std::vector<uint32_t> first_instance;
  Aabb bounds;
  // Of groups of triangles, so that there are not too many.
  size_t triangles = 0;
  for (uint32_t m = 0; m < meshes_.size(); ++m) triangles += meshes_[m].triangle_count() * instance_count(m);
  const size_t group = 3 * (1 + triangles / kMostExtentBoxes);
  std::vector<Aabb> boxes;
  std::vector<float> thickness(meshes_.size(), 0.0f);
  for (uint32_t m = 0; m < meshes_.size(); ++m) {
    const Mesh& mesh = meshes_[m];
    bool cutout = false, passes_light = false, absorbs = false;
    const auto meet = [&](const Material& material) {
      cutout = cutout || material.cutout(), passes_light = passes_light || material.shadows_pass;
      absorbs = absorbs || material.absorbs_straight();
    };
    if (mesh.triangle_materials.empty() && mesh.triangle_count() > 0) meet(materials_[mesh.material]);
    for (uint32_t material : mesh.triangle_materials) meet(materials_[material]);
    geometry.meshes.push_back({mesh.positions.data(), mesh.positions.size(), mesh.indices.data(), mesh.triangle_count(),
                               mesh.ray_mask(), cutout, passes_light});
    if (absorbs) thickness[m] = thickness_of(mesh, materials_);
    first_instance.push_back(static_cast<uint32_t>(geometry.instances.size()));
    for (uint32_t i = 0; i < instance_count(m); ++i) {
      const Transform& t = instance(m, i);
      if (instanced) geometry.instances.push_back({m, t});
      Aabb box;
      for (size_t k = 0; k < mesh.indices.size(); ++k) {
        if (k % 65536 == 0) progress.check();
        if (k > 0 && k % group == 0) boxes.push_back(box), bounds.extend(box), box = {};
        const uint32_t index = mesh.indices[k];
        const Vec3f p = t.point(mesh.positions[index]);
        box.extend(p);
        if (within(p, kLargestCoordinate)) continue;
        fail_argument(at("mesh", m) + " vertex " + std::to_string(index) + " of " + at("instance", i) + " lies at (" +
                      short_text(p.x) + ", " + short_text(p.y) + ", " + short_text(p.z) + "), beyond " +
                      short_text(kLargestCoordinate));
      }
      boxes.push_back(box), bounds.extend(box);
    }
  }
  SceneExtent extent(std::move(boxes));

  auto accel =
      trace_ ? trace_(geometry) : make_accel(config_.accel, geometry, {config_.robust, config_.builder}, &progress);
  accel_ = std::move(accel);
  first_instance_ = std::move(first_instance), thickness_ = std::move(thickness);
  instanced_ = instanced;
  has_programs_ =
      std::any_of(textures_.begin(), textures_.end(), [](const Texture& t) { return t.program() != nullptr; });
  asks_for_camera_ = std::any_of(textures_.begin(), textures_.end(), [](const Texture& t) {
    return t.program() != nullptr && t.program()->asks_for_camera();
  });
  bounds_ = bounds;
  radius_ = bounds.empty() || bounds.diagonal() == 0.0f ? 1.0f : 0.5f * bounds.diagonal();
  extent_ = std::move(extent);
  committed_ = true;
  ++version_;
  progress.advance(1);
}

uint32_t Scene::scattered_ray_mask() const {
  const bool differ = std::any_of(meshes_.begin(), meshes_.end(), [](const Mesh& m) {
    return ((m.mask & kDiffuseRay) != 0) != ((m.mask & kShadowRay) != 0);
  });
  return differ ? kDiffuseRay : kShadowRay;
}

const Transform& Scene::instance(uint32_t mesh, uint32_t index) const {
  static const Transform identity;
  return meshes_[mesh].instances.empty() ? identity : meshes_[mesh].instances[index];
}

bool Scene::passes(const CandidateHit& hit) const {
  const uint32_t instance_index = hit.inst != kNoId ? hit.inst - first_instance_[hit.mesh] : 0;
  return passes_by_chance(opacity(hit.mesh, hit.prim, hit.u, hit.v, instance_index, &hit.dir), hit.mesh, hit.prim,
                          hit.u, hit.v);
}

// Visibility is a yes or no: the chance is what passes of one channel, which is the luminance in the mean.
bool Scene::passes_light(const CandidateHit& hit) const {
  const Mesh& mesh = meshes_[hit.mesh];
  const uint32_t id = mesh.material_of(hit.prim);
  const uint32_t instance_index = hit.inst != kNoId ? hit.inst - first_instance_[hit.mesh] : 0;
  float stops = opacity(hit.mesh, hit.prim, hit.u, hit.v, instance_index, &hit.dir);
  if (stops > 0.0f && materials_[id].shadows_pass) {
    const uint32_t* t = &mesh.indices[3 * size_t{hit.prim}];
    Vec3f corner = mesh.positions[t[0]];
    Vec3f edges[2] = {mesh.positions[t[1]] - corner, mesh.positions[t[2]] - corner}, dir = hit.dir;
    Vec3f front = cross(edges[0], edges[1]);
    if (hit.inst != kNoId) {
      const Transform& to_world = instance(hit.mesh, instance_index);
      corner = to_world.point(corner), edges[0] = to_world.vector(edges[0]), edges[1] = to_world.vector(edges[1]),
      dir = to_world.vector(dir), front = to_world.normal(front);
    }
    const Vec3f normal = facing(normalize(cross(edges[0], edges[1])), front), to_viewer = -normalize(dir);
    const SurfaceView view{{}, normal, normal, to_viewer, 0.0f};
    std::optional<SurfaceHit> place;
    if (has_programs_) place = place_on(hit.mesh, hit.prim, hit.u, hit.v, instance_index);
    const BsdfParameters glass =
        place ? bsdf_parameters(id, place->uv,
                                {place->position, place->geometric_normal, place->normal, to_viewer, place->offset},
                                &*place)
              : bsdf_parameters(id, uv_at(mesh, hit.prim, hit.u, hit.v), view);
    const float cosine = std::abs(dot(normal, to_viewer));
    Rgb passed = straight_transmittance(glass, cosine, dot(normal, to_viewer) < 0.0f);
    if (thickness_[hit.mesh] > 0.0f) {
      // Half of the way at each border, as slanted as light is inside.
      const float size = hit.inst != kNoId ? instance(hit.mesh, instance_index).scale() : 1.0f;
      const float inside = std::sqrt(std::max(0.0f, 1.0f - (1.0f - cosine * cosine) / (glass.ior * glass.ior)));
      const float way = 0.5f * size * thickness_[hit.mesh] / std::max(inside, 1e-3f);
      for (int k = 0; k < 3; ++k) passed[k] *= std::exp(-glass.absorption[k] * way);
    }
    const bool grey = passed.x == passed.y && passed.y == passed.z;
    const Vec3f at = corner + edges[0] * hit.u + edges[1] * hit.v;
    stops *= 1.0f - (grey ? luminance(passed) : passed[channel_of(at, to_viewer, extent_.radius())]);
  }
  return passes_by_chance(stops, hit.mesh, hit.prim, hit.u, hit.v);
}

float Scene::opacity(uint32_t mesh_id, uint32_t prim, float u, float v, uint32_t instance_index,
                     const Vec3f* local_dir) const {
  const Mesh& mesh = meshes_[mesh_id];
  const Material& material = materials_[mesh.material_of(prim)];
  float opacity = material.opacity;
  if (material.opacity_texture < 0) return opacity;
  if (const TextureProgram* program = textures_[material.opacity_texture].program()) {
    const SurfaceHit place = place_on(mesh_id, prim, u, v, instance_index);
    Vec3f to_viewer = place.geometric_normal;
    if (program->varies_with_view())
      to_viewer = local_dir == nullptr ? mean_view(place.geometric_normal)
                                       : -normalize(instance(mesh_id, instance_index).vector(*local_dir));
    return programmed_opacity(place, *program, to_viewer);
  }
  if (!mesh.uvs.empty()) {
    const Vec2f at = uv_at(mesh, prim, u, v);
    opacity *= textures_[material.opacity_texture].mask(at.x, at.y);
  }
  return opacity;
}

float Scene::programmed_opacity(const SurfaceHit& place, const TextureProgram& program, const Vec3f& to_viewer) const {
  const SurfaceView view{place.position, place.geometric_normal, place.normal, to_viewer, place.offset};
  return materials_[place.material].opacity * std::clamp(programmed(program, view, place.uv, &place).x, 0.0f, 1.0f);
}

float Scene::stopped_share(const RayHit& from_light) const {
  constexpr float kMost = 10.0f;  // brighter lights would show as spots
  const Hit& hit = from_light.hit;
  const int32_t texture = materials_[meshes_[hit.geom].material_of(hit.prim)].opacity_texture;
  const TextureProgram* program = texture < 0 ? nullptr : textures_[texture].program();
  if (program == nullptr || !program->varies_with_view()) return 1.0f;
  const SurfaceHit place = place_on(hit.geom, hit.prim, hit.u, hit.v, instance_of(hit));
  const float seen = programmed_opacity(place, *program, -from_light.ray.dir),
              stopped = programmed_opacity(place, *program, from_light.ray.dir);
  return seen < kMost * stopped ? seen / stopped : kMost;
}

float Scene::offset_at(const Vec3f& position) const {
  return kOffset * std::max(2.0f * largest_coordinate(position), extent_.radius());
}

SurfaceHit Scene::place_on(uint32_t mesh, uint32_t prim, float u, float v, uint32_t instance_index) const {
  RayHit hit;
  hit.hit.u = u, hit.hit.v = v, hit.hit.prim = prim, hit.hit.geom = mesh;
  hit.hit.inst = hit_instance(mesh, instance_index);
  return surface(hit, false);
}

SurfaceHit Scene::surface(const RayHit& rh, bool turn_normal) const {
  const Hit& hit = rh.hit;
  const Mesh& mesh = meshes_[hit.geom];
  const uint32_t* tri = &mesh.indices[3 * size_t{hit.prim}];
  const Transform& to_world = instance(hit.geom, instance_of(hit));
  Vec3f p[3];
  for (int k = 0; k < 3; ++k) p[k] = instanced_ ? to_world.point(mesh.positions[tri[k]]) : mesh.positions[tri[k]];
  const float w = 1.0f - hit.u - hit.v;

  SurfaceHit s;
  s.mesh = hit.geom;
  s.triangle = hit.prim;
  s.instance = instance_of(hit);
  s.u = hit.u, s.v = hit.v;
  s.material = mesh.material_of(hit.prim);
  s.t = rh.ray.tfar;
  s.position = p[0] * w + p[1] * hit.u + p[2] * hit.v;
  float largest = std::max({largest_coordinate(p[0]), largest_coordinate(p[1]), largest_coordinate(p[2])});
  if (instanced_)  // by way of local coordinates, which may be larger
    for (int k = 0; k < 3; ++k) largest = std::max(largest, largest_term(to_world, mesh.positions[tri[k]]));
  s.offset = kOffset * largest;
  s.geometric_normal = normalize(cross(p[1] - p[0], p[2] - p[0]));
  // A mirroring instance turns the winding over; the front stays the front.
  if (instanced_) {
    const Vec3f local =
        cross(mesh.positions[tri[1]] - mesh.positions[tri[0]], mesh.positions[tri[2]] - mesh.positions[tri[0]]);
    s.geometric_normal = facing(s.geometric_normal, to_world.normal(local));
  }
  if (s.geometric_normal == Vec3f{}) s.geometric_normal = normalize(-rh.ray.dir);
  s.normal = s.geometric_normal;
  if (!mesh.normals.empty()) {
    Vec3f n = mesh.normals[tri[0]] * w + mesh.normals[tri[1]] * hit.u + mesh.normals[tri[2]] * hit.v;
    if (instanced_) n = to_world.normal(n);
    n = normalize(n);
    if (n != Vec3f{}) s.normal = dot(n, s.geometric_normal) < 0.0f ? -n : n;
  }
  const Vec3f smooth = s.normal;
  if (!mesh.uvs.empty()) {
    const Vec2f a = mesh.uvs[tri[0]], b = mesh.uvs[tri[1]], c = mesh.uvs[tri[2]];
    s.uv = {a.x * w + b.x * hit.u + c.x * hit.v, a.y * w + b.y * hit.u + c.y * hit.v};
    if (const Material& material = materials_[s.material];
        (material.normal_texture >= 0 && textures_[material.normal_texture].program() == nullptr) ||
        material.height_texture >= 0)
      s.normal = mapped_normal(material, s, {p[1] - p[0], p[2] - p[0]}, {a, b, c});
  }
  if (const int32_t turned = materials_[s.material].normal_texture; turned >= 0 && turn_normal)
    if (const TextureProgram* program = textures_[turned].program())
      s.normal = programmed_normal(*program, s, -rh.ray.dir);
  if (materials_[s.material].bump_shadows && s.normal != smooth) s.smooth = smooth;
  return s;
}

Vec3f Scene::programmed_normal(const TextureProgram& program, const SurfaceHit& hit, const Vec3f& to_viewer) const {
  const SurfaceView view{hit.position, hit.geometric_normal, hit.normal, to_viewer, hit.offset};
  const float side = dot(hit.geometric_normal, to_viewer) < 0.0f ? -1.0f : 1.0f;
  return above_surface(programmed(program, view, hit.uv, &hit) * side, hit);
}

Rgb Scene::programmed(const TextureProgram& program, const SurfaceView& view, Vec2f uv, const SurfaceHit* hit) const {
  ProgramPoint p;
  p.behind = dot(view.geometric_normal, view.to_viewer) < 0.0f;
  p.position = view.position;
  p.normal = p.behind ? -view.normal : view.normal;
  p.geometric_normal = p.behind ? -view.geometric_normal : view.geometric_normal;
  p.to_viewer = view.to_viewer;
  p.uv = uv;
  p.camera = &camera_;
  if (hit != nullptr) {
    p.mesh = &meshes_[hit->mesh], p.triangle = hit->triangle, p.instance = hit->instance;
    p.u = hit->u, p.v = hit->v;
    if (instanced_) p.to_world = &instance(hit->mesh, hit->instance);
    p.distance = std::isfinite(hit->t) ? hit->t : 0.0f, p.least_step = kLeastBumpStep * hit->offset;
  }
  return program.evaluate(p, textures_);
}

// Blinn's bumps: the height along the normal, by its slope over a texel. [Blinn 1978; as Blender has it: the distance
// scales the slope, the strength mixes the turned normal with the old.]
Vec3f Scene::bumped_normal(const Material& material, const Vec3f& normal, Vec2f uv, const Vec3f& along_u,
                           const Vec3f& along_v) const {
  const Texture& heights = textures_[material.height_texture];
  const float du = 1.0f / static_cast<float>(heights.width()), dv = 1.0f / static_cast<float>(heights.height());
  const auto height = [&](float u, float v) { return luminance(heights.color(u, v)); };
  const float slope_u = (height(uv.x + 0.5f * du, uv.y) - height(uv.x - 0.5f * du, uv.y)) / du,
              slope_v = (height(uv.x, uv.y + 0.5f * dv) - height(uv.x, uv.y - 0.5f * dv)) / dv;
  const Vec3f across_v = cross(along_v, normal);
  const float det = dot(along_u, across_v);
  const Vec3f gradient = across_v * slope_u + cross(normal, along_u) * slope_v;
  const float sign = det < 0.0f ? -1.0f : 1.0f;
  const Vec3f turned = normalize(normal * std::abs(det) - gradient * (sign * material.bump_distance));
  if (turned == Vec3f{} || !is_finite(turned)) return normal;
  return normalize(normal + (turned - normal) * material.bump_strength);
}

// The tangent is the triangle's own direction of growing u, laid into the shading normal's plane: seams of the map
// between triangles are not smoothed over.
Vec3f Scene::mapped_normal(const Material& material, const SurfaceHit& hit, const Vec3f (&edges)[2],
                           const Vec2f (&corners)[3]) const {
  const Vec2f d1{corners[1].x - corners[0].x, corners[1].y - corners[0].y},
      d2{corners[2].x - corners[0].x, corners[2].y - corners[0].y};
  const float det = d1.x * d2.y - d2.x * d1.y;
  if (!(std::abs(det) > 0.0f)) return hit.normal;
  const Vec3f along_u = (edges[0] * d2.y - edges[1] * d1.y) / det, along_v = (edges[1] * d1.x - edges[0] * d2.x) / det;
  if (!is_finite(along_u) || !is_finite(along_v)) return hit.normal;
  Vec3f n = hit.normal;
  if (material.normal_texture >= 0) {
    const Vec3f t = normalize(along_u - hit.normal * dot(along_u, hit.normal));
    if (t == Vec3f{} || !is_finite(t)) return hit.normal;
    Vec3f b = cross(hit.normal, t);
    if (dot(b, along_v) < 0.0f) b = -b;
    const Rgb c = textures_[material.normal_texture].color(hit.uv.x, hit.uv.y);
    const Vec3f local = normalize(Vec3f{2.0f * c.x - 1.0f, 2.0f * c.y - 1.0f, std::max(0.0f, 2.0f * c.z - 1.0f)});
    if (local == Vec3f{}) return hit.normal;
    const Vec3f bent = t * local.x + b * local.y + hit.normal * local.z;
    n = normalize(hit.normal + (bent - hit.normal) * material.normal_strength);
  }
  if (material.height_texture >= 0) n = bumped_normal(material, n, hit.uv, along_u, along_v);
  return above_surface(n, hit);
}

SurfaceInteraction Scene::interaction(const SurfaceHit& hit, const Vec3f& to_viewer, uint32_t pixel) const {
  const SurfaceView view{hit.position, hit.geometric_normal,        hit.normal, to_viewer, hit.offset, pixel,
                         hit.smooth,   meshes_[hit.mesh].not_lit_by};
  return {hit, emitted(hit, to_viewer), bsdf_parameters(hit.material, hit.uv, view, &hit), view};
}

BsdfParameters Scene::bsdf_parameters(uint32_t material, Vec2f uv, const SurfaceView& view,
                                      const SurfaceHit* hit) const {
  const Material& m = materials_[material];
  const auto share = [](float x) { return std::min(1.0f, std::max(0.0f, x)); };
  const auto color = [&](int32_t texture) {
    const Texture& t = textures_[texture];
    if (const TextureProgram* program = t.program()) return programmed(*program, view, uv, hit);
    if (!t.is_by_view()) return t.color(uv.x, uv.y);
    return t.by_view(std::abs(dot(view.normal, view.to_viewer)), dot(view.geometric_normal, view.to_viewer) < 0.0f);
  };
  const auto texel = [&](const Rgb& factor, int32_t texture) {
    if (texture < 0) return factor;
    const Rgb c = factor * color(texture);
    return Rgb{share(c.x), share(c.y), share(c.z)};
  };
  BsdfParameters p;
  p.model = m.lobe;
  p.diffuse = texel(m.diffuse, m.diffuse_texture), p.specular = texel(m.specular, m.specular_texture);
  p.translucency = texel(m.translucency, m.translucency_texture);
  p.exponent = m.shininess;
  if (m.lobe != LobeModel::ggx) {
    if (m.oren_nayar) p.slope = m.roughness, p.diffuse_once = m.facets_once;
    return p;
  }
  p.facets_once = m.facets_once, p.diffuse_once = m.diffuse_once;
  p.slope = m.diffuse_roughness;
  if (m.diffuse_roughness_texture >= 0) p.slope *= share(color(m.diffuse_roughness_texture).y);
  p.fresnel = m.fresnel, p.bright_lobe = m.bright_lobe, p.additive = m.burley, p.specular_tint = m.specular_tint;
  float roughness = m.roughness;
  if (m.roughness_texture >= 0) roughness *= share(color(m.roughness_texture).y);
  p.alpha = roughness * roughness;
  p.metallic = m.metallic;
  if (m.metallic_texture >= 0) p.metallic = share(p.metallic * color(m.metallic_texture).z);
  p.ior = m.ior, p.transmission = m.transmission;
  p.coat = m.coat, p.coat_alpha = m.coat_alpha(), p.coat_ior = m.coat_ior;
  p.glass = glass_[material].get();
  p.shadows_pass = m.shadows_pass, p.open_glass = m.open_glass, p.absorption = m.absorption;
  return p;
}

bool Scene::may_be_lobed() const {
  return std::any_of(materials_.begin(), materials_.end(), [](const Material& m) { return m.may_be_lobed(); });
}

bool Scene::may_be_specular() const {
  return std::any_of(materials_.begin(), materials_.end(), [](const Material& m) { return m.may_be_specular(); });
}

Rgb Scene::light_value(const Light& light, const Vec3f& at) const {
  if (light.texture < 0) return light.value;
  const Vec3f d = at - light.position;
  return light.value * max(textures_[light.texture].color(0.5f + dot(d, light.u) / length2(light.u),
                                                          0.5f + dot(d, light.v) / length2(light.v)),
                           Rgb{});
}

Rgb Scene::emitted(const SurfaceHit& hit, const Vec3f& to_viewer) const {
  const Material& m = materials_[hit.material];
  if (!m.emissive() || (!m.emit_both_sides && dot(hit.geometric_normal, to_viewer) <= 0.0f)) return {};
  if (m.emission_texture < 0) return m.emission;
  const Texture& texture = textures_[m.emission_texture];
  if (const TextureProgram* program = texture.program()) {
    const SurfaceView view{hit.position, hit.geometric_normal, hit.normal, to_viewer, hit.offset};
    return m.emission * max(programmed(*program, view, hit.uv, &hit), Rgb{});
  }
  return m.emission * texture.color(hit.uv.x, hit.uv.y);
}

// As it is seen at the mean cosine of what a surface sends out evenly.
Rgb Scene::emitted_on_average(const SurfaceHit& hit, const Vec3f& normal) const {
  const int32_t texture = materials_[hit.material].emission_texture;
  const TextureProgram* program = texture < 0 ? nullptr : textures_[texture].program();
  if (program == nullptr || !program->varies_with_view()) return emitted(hit, normal);
  return emitted(hit, mean_view(normal));
}

Vec2f Scene::environment_uv(const Vec3f& direction) const {
  const float* m = environment_.world_to_map;
  const Vec3f d{m[0] * direction.x + m[1] * direction.y + m[2] * direction.z,
                m[3] * direction.x + m[4] * direction.y + m[5] * direction.z,
                m[6] * direction.x + m[7] * direction.y + m[8] * direction.z};
  return {0.5f - std::atan2(d.y, d.x) * (0.5f * kInvPi), 0.5f + std::atan2(d.z, std::hypot(d.x, d.y)) * kInvPi};
}

Rgb Scene::environment_radiance(const Vec3f& direction) const {
  if (environment_.texture < 0) return environment_.color;
  const Vec2f uv = environment_uv(direction);
  return environment_.color * textures_[environment_.texture].color(uv.x, uv.y);
}

}  // namespace lumicut
