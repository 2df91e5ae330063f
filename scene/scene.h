// What is rendered: meshes, materials, textures, lights, environment, camera, and the accel that traces rays in it.
// Setters keep the host's data; `commit` checks it as a whole and builds. After commit all queries are [shared].
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "accel/accel.h"
#include "core/fields.h"
#include "scene/camera.h"
#include "scene/light.h"
#include "scene/light_profile.h"
#include "scene/material.h"
#include "scene/mesh.h"
#include "scene/ray_kind.h"
#include "scene/scene_extent.h"
#include "scene/surface_interaction.h"
#include "scene/texture.h"

namespace lumicut {

class Scene final : private HitFilter {
 public:
  struct Config {
    std::string accel = kDefaultAccel;
    bool robust = true;
    std::string builder = "";  // of "bvh"
    LUMICUT_FIELDS(Config, accel, robust, builder)
  };
  // Makes the host's own tracer over this scene's geometry (accel/host_accel.h).
  using AccelFactory = std::function<std::unique_ptr<Accel>(const AccelGeometry&)>;

  explicit Scene(Config config) : config_(std::move(config)) {}
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;

  void set_textures(std::vector<Texture> textures);
  void set_materials(std::vector<Material> materials);
  // Returns the mesh's id. Throws on indices out of range, non-finite positions or transforms, arrays of wrong length.
  uint32_t add_mesh(Mesh mesh);
  // Empty vectors: unchanged. Counts must be as before.
  void update_mesh(uint32_t id, std::vector<Vec3f> positions, std::vector<Vec3f> normals,
                   std::vector<Transform> instances);
  // `profiles`: those that the lights name.
  void set_lights(std::vector<Light> lights, LightProfiles profiles = {});
  void set_environment(const Environment& environment);
  void set_camera(const Camera& camera);
  void set_trace(AccelFactory factory);  // empty: ours again

  // Checks references between the parts (naming what is wrong), builds the accel. Any setter asks for a new commit.
  void commit(Progress& progress);
  bool committed() const { return committed_; }
  // Rises with each commit: integrators prepared against an older one prepare again.
  uint64_t version() const { return version_; }

  // Calls visit(name, part) for all that the host set, a tracer of its own as whether there is one. Each member is
  // named here, so that a new one does not compile before it is decided whether it is visited or follows from the
  // others.
  template <typename Visit>
  void for_each_part(Visit&& visit) const {
    const auto& [config, textures, materials, glass, most_layers, meshes, lights, profiles, environment, camera,
                 has_camera, trace, accel, first_instance, thickness, instanced, has_programs, asks_for_camera,
                 committed, version, bounds, radius, extent] = *this;
    const bool host_trace = trace != nullptr;
    visit("accel", config);
    visit("host_trace", host_trace);
    visit("textures", textures);
    visit("materials", materials);
    visit("meshes", meshes);
    visit("lights", lights);
    visit("environment", environment);
    visit("camera", camera);
    visit("light profiles", profiles);
  }

  const Accel& accel() const { return *accel_; }
  const std::vector<Mesh>& meshes() const { return meshes_; }
  const std::vector<Material>& materials() const { return materials_; }
  const std::vector<Texture>& textures() const { return textures_; }
  const std::vector<Light>& lights() const { return lights_; }
  const LightProfiles& profiles() const { return profiles_; }
  const Environment& environment() const { return environment_; }
  const Camera& camera() const { return camera_; }
  bool has_camera() const { return has_camera_; }
  // World bounds of all instances; empty without geometry.
  const Aabb& bounds() const { return bounds_; }
  // Half the diagonal of the bounds; 1 without geometry. One distant object makes it as large as it likes: extent()
  // serves where a picture could feel that.
  float radius() const { return radius_; }
  const SceneExtent& extent() const { return extent_; }
  // RayKind of the shadow rays of bounced light: it comes with a scattered ray, which may see other meshes than one
  // that asks for a lamp. As theirs where no mesh tells the two apart.
  uint32_t scattered_ray_mask() const;
  // How far ray ends stand off a place whose triangle is not known, such as a host's own point.
  float offset_at(const Vec3f& position) const;

  size_t instance_count(uint32_t mesh) const { return std::max<size_t>(1, meshes_[mesh].instances.size()); }
  const Transform& instance(uint32_t mesh, uint32_t index) const;
  // Which instance of its mesh a hit of `accel()` is on.
  uint32_t instance_of(const Hit& hit) const { return instanced_ ? hit.inst - first_instance_[hit.geom] : 0; }
  // What a hit of `accel()` on that instance of that mesh carries in Hit::inst.
  uint32_t hit_instance(uint32_t mesh, uint32_t index) const {
    return instanced_ ? first_instance_[mesh] + index : kNoId;
  }

  // Geometry of a hit of `accel()`. Normal maps turn its shading normal, if they shall; a host's own points bring theirs.
  SurfaceHit surface(const RayHit& hit, bool turn_normal = true) const;
  // A place of a triangle as a hit without a ray, its normal not turned.
  SurfaceHit place_on(uint32_t mesh, uint32_t triangle, float u, float v, uint32_t instance) const;
  // All of a hit, seen along its ray.
  SurfaceInteraction interaction(const RayHit& hit, uint32_t pixel = 0) const {
    return interaction(surface(hit), -hit.ray.dir, pixel);
  }
  SurfaceInteraction interaction(const SurfaceHit& hit, const Vec3f& to_viewer, uint32_t pixel = 0) const;
  // How a place scatters light: of a host's own point too. `material` must be in range (checked by the caller).
  Bsdf bsdf(const SurfaceView& view, uint32_t material, Vec2f uv) const {
    return {bsdf_parameters(material, uv, view), view};
  }
  // The material's description there, its textures looked up. Without `hit` programs know nothing of the mesh.
  BsdfParameters bsdf_parameters(uint32_t material, Vec2f uv, const SurfaceView& view = {},
                                 const SurfaceHit* hit = nullptr) const;
  // How many layers a point has at most, by the materials: rough clear coats and translucency add one each.
  size_t most_layers() const { return most_layers_; }
  // Whether any material may have a specular lobe.
  bool may_be_specular() const;
  // Whether any surface's diffuse lobe may not be Lambert's.
  bool may_be_lobed() const;
  // Of a rectangle or disk at a place on it: its value, and its texture there.
  Rgb light_value(const Light& light, const Vec3f& at) const;
  // Radiance emitted by a surface towards `to_viewer`.
  Rgb emitted(const SurfaceHit& hit, const Vec3f& to_viewer) const;
  // About the mean of that over the side that `normal` points to, where the view makes a difference.
  Rgb emitted_on_average(const SurfaceHit& hit, const Vec3f& normal) const;
  // Share of rays that a place of a triangle stops: factor times mask.
  // `local_dir`: of the ray, in the mesh's own space; without one it is about the mean over views from the front.
  float opacity(uint32_t mesh, uint32_t prim, float u, float v, uint32_t instance = 0,
                const Vec3f* local_dir = nullptr) const;
  // Of light that such a ray brought and a surface stopped: what is reflected, which is seen from the ray's side, as a share
  // of what does not pass, which would be seen from the other. Bounded.
  float stopped_share(const RayHit& from_light) const;
  // Whether what surfaces look like depends on the camera.
  bool asks_for_camera() const { return asks_for_camera_; }

  // Radiance of the environment seen along `direction` (unit).
  Rgb environment_radiance(const Vec3f& direction) const;
  // Where on the map it is seen; u repeats.
  Vec2f environment_uv(const Vec3f& direction) const;

 private:
  // By the height texture, then the normal texture. `edges`: from the triangle's first corner to the others.
  // `corners`: its uvs.
  Vec3f mapped_normal(const Material& material, const SurfaceHit& hit, const Vec3f (&edges)[2],
                      const Vec2f (&corners)[3]) const;
  // By the normal texture, a program: the normal itself, in the world.
  Vec3f programmed_normal(const TextureProgram& program, const SurfaceHit& hit, const Vec3f& to_viewer) const;
  float programmed_opacity(const SurfaceHit& place, const TextureProgram& program, const Vec3f& to_viewer) const;
  Rgb programmed(const TextureProgram& program, const SurfaceView& view, Vec2f uv, const SurfaceHit* hit) const;
  Vec3f bumped_normal(const Material& material, const Vec3f& normal, Vec2f uv, const Vec3f& along_u,
                      const Vec3f& along_v) const;
  bool passes(const CandidateHit& hit) const override;
  bool passes_light(const CandidateHit& hit) const override;
  void check_references() const;

  Config config_;
  std::vector<Texture> textures_;
  std::vector<Material> materials_;
  std::vector<std::shared_ptr<const GlassAlbedo>> glass_;  // of rough glass; one for each index of refraction
  size_t most_layers_ = 1;
  std::vector<Mesh> meshes_;
  std::vector<Light> lights_;
  LightProfiles profiles_;
  Environment environment_;
  Camera camera_;
  bool has_camera_ = false;
  AccelFactory trace_;
  std::unique_ptr<Accel> accel_;
  std::vector<uint32_t> first_instance_;  // of each mesh, in AccelGeometry::instances
  std::vector<float> thickness_;          // of each mesh whose glass absorbs what goes straight through it, else 0
  bool instanced_ = false;
  bool has_programs_ = false, asks_for_camera_ = false;
  bool committed_ = false;
  uint64_t version_ = 0;
  Aabb bounds_;
  float radius_ = 1.0f;
  SceneExtent extent_;
};

}  // namespace lumicut
