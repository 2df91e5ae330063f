// What hosts describe → what the library computes with: every field is checked, and lights in watt become radiometric.
// [docs/units.md] All throw Error naming field and value.
#pragma once

#include <memory>

#include "film/film.h"
#include "lights/vpl.h"
#include "plugin/boundary.h"
#include "plugin/include/lumicut/lumicut_lights.h"
#include "render/frame.h"
#include "render/iterations.h"
#include "scene/scene.h"

namespace lumicut {

// What traces rays: the fields that a scene and an accel alone have in common.
Scene::Config to_accel(const char* owner, uint32_t robust, const char* kind, const char* builder);

Texture to_texture(const lumicut_texture& in, uint64_t index);
Material to_material(const lumicut_material& in, uint64_t index);
Mesh to_mesh(const lumicut_mesh& in);
Light to_light(const lumicut_light& in, uint64_t index, const std::vector<ProfileRef>& profiles);
ProfileRef to_profile(const lumicut_profile& in, uint64_t index);
Environment to_environment(const lumicut_environment& in);
Camera to_camera(const lumicut_camera& in);

// Arrays of an update; NULL gives an empty vector.
std::vector<Vec3f> to_positions(const float* xyz, uint64_t count, const char* owner);
std::vector<Vec3f> to_normals(const float* xyz, uint64_t count);  // unchecked: the scene mends broken ones
std::vector<Transform> to_transforms(const float* m, uint64_t count, const char* owner);

// A host's lights, those of emitters first. Normals within 1 % of unit length are made unit. Profiles that they name are
// looked for in `known` first, then among all of the process.
VplSet to_vpls(const lumicut_vpl_set& in, const LightProfiles& known = {});

// The same the other way.
struct HostVpls {
  std::vector<lumicut_vpl> lights;
  std::vector<lumicut_vpl_origin> origins;
  uint64_t light_paths = 0, emitter_samples = 0;
  lumicut_vpl_set view() const;
};
HostVpls from_vpls(const VplSet& set);

// Points [first, last) of a host, checked against the scene's materials and appended to `out`, where a clear coat's
// lobe follows its point. Where the scene has any: the place of each point in `out`; else empty.
std::vector<uint64_t> append_points(const Scene& scene, const lumicut_point* points, uint64_t first, uint64_t last,
                                    ShadePoints& out);
void check_points(const Scene& scene, const lumicut_point* points, uint64_t count);

// Size, crop, samples and tiles.
FrameOptions to_frame_options(const lumicut_render_desc& in);
// The host's rectangle, NULL for the whole crop. Throws Error where it does not lie inside.
Rect part_of(const Rect& crop, const lumicut_tile* rect);
IterationOptions to_pass_options(const lumicut_render_desc& in);
// Fails where that is more than the machine's memory.
void check_render_bytes(const Rect& crop, uint64_t bytes);

}  // namespace lumicut
