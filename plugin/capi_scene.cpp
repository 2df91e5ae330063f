// Level 2: scenes.
#include "plugin/check.h"
#include "plugin/convert.h"
#include "plugin/descriptors.h"
#include "plugin/host_trace.h"
#include "plugin/objects.h"

using namespace lumicut;

namespace {

// Runs `fn` on a scene that nobody uses. `fn` either changes all that it says or throws before it changes anything.
template <typename Fn>
lumicut_result change_scene(lumicut_scene scene, const char* caller, const Fn& fn) {
  return guard([&] {
    lumicut_scene_t& s = object(scene);
    const AccessGuard::Hold hold = s.gate.change(caller);
    fn(s);
  });
}

template <typename Out, typename In, typename Fn>
std::vector<Out> convert_all(const std::vector<In>& in, const Fn& fn) {
  std::vector<Out> out;
  out.reserve(in.size());
  for (size_t i = 0; i < in.size(); ++i) out.push_back(fn(in[i], i));
  return out;
}

}  // namespace

lumicut_result lumicut_scene_create(lumicut_device device, const lumicut_scene_desc* desc, lumicut_scene* scene) {
  return guard([&] {
    lumicut_device_t& d = object(device);
    const lumicut_scene_desc in = desc == nullptr ? lumicut_scene_desc{} : read(desc);
    if (scene == nullptr) fail_argument("lumicut_scene_create: scene is NULL");
    *scene = new lumicut_scene_t(d, to_accel("lumicut_scene_desc", in.robust, in.accel, in.builder));
  });
}

lumicut_result lumicut_scene_set_textures(lumicut_scene scene, const lumicut_texture* textures, uint64_t count) {
  return change_scene(scene, "lumicut_scene_set_textures", [&](lumicut_scene_t& s) {
    s.scene.set_textures(convert_all<Texture>(read_array(textures, count), to_texture));
    s.changed = true;
  });
}

lumicut_result lumicut_scene_set_materials(lumicut_scene scene, const lumicut_material* materials, uint64_t count) {
  return change_scene(scene, "lumicut_scene_set_materials", [&](lumicut_scene_t& s) {
    s.scene.set_materials(convert_all<Material>(read_array(materials, count), to_material));
    s.changed = true;
  });
}

lumicut_result lumicut_scene_add_mesh(lumicut_scene scene, const lumicut_mesh* mesh, uint32_t* id) {
  return change_scene(scene, "lumicut_scene_add_mesh", [&](lumicut_scene_t& s) {
    const uint32_t added = s.scene.add_mesh(to_mesh(read(mesh)));
    s.changed = true;
    if (id != nullptr) *id = added;
  });
}

lumicut_result lumicut_scene_update_mesh(lumicut_scene scene, uint32_t id, const float* positions, const float* normals,
                                         const float* transforms) {
  return change_scene(scene, "lumicut_scene_update_mesh", [&](lumicut_scene_t& s) {
    const std::vector<Mesh>& meshes = s.scene.meshes();
    if (id >= meshes.size())
      fail_argument("lumicut_scene_update_mesh: id " + number_text(uint64_t{id}) + " is out of range: the scene has " +
                    number_text(uint64_t{meshes.size()}) + " meshes");
    const size_t vertices = meshes[id].positions.size();
    s.scene.update_mesh(id, to_positions(positions, vertices, "lumicut_scene_update_mesh"),
                        to_normals(normals, vertices),
                        to_transforms(transforms, s.scene.instance_count(id), "lumicut_scene_update_mesh"));
    s.changed = true;
  });
}

lumicut_result lumicut_scene_set_profiles(lumicut_scene scene, const lumicut_profile* profiles, uint64_t count) {
  return change_scene(scene, "lumicut_scene_set_profiles", [&](lumicut_scene_t& s) {
    auto made = convert_all<ProfileRef>(read_array(profiles, count), to_profile);
    LightProfiles named;
    for (const ProfileRef& profile : made) named.add(profile);  // throws where two share a name
    s.profiles = std::move(made);
  });
}

lumicut_result lumicut_scene_set_lights(lumicut_scene scene, const lumicut_light* lights, uint64_t count) {
  return change_scene(scene, "lumicut_scene_set_lights", [&](lumicut_scene_t& s) {
    LightProfiles used;
    auto made = convert_all<Light>(read_array(lights, count), [&](const lumicut_light& light, uint64_t i) {
      Light of = to_light(light, i, s.profiles);
      if (light.profile != 0) used.add(s.profiles[light.profile - 1]);
      return of;
    });
    s.scene.set_lights(std::move(made), std::move(used));
    s.changed = true;
  });
}

lumicut_result lumicut_scene_set_environment(lumicut_scene scene, const lumicut_environment* environment) {
  return change_scene(scene, "lumicut_scene_set_environment", [&](lumicut_scene_t& s) {
    s.scene.set_environment(environment == nullptr ? Environment{} : to_environment(read(environment)));
    s.changed = true;
  });
}

lumicut_result lumicut_scene_set_camera(lumicut_scene scene, const lumicut_camera* camera) {
  return change_scene(scene, "lumicut_scene_set_camera", [&](lumicut_scene_t& s) {
    s.scene.set_camera(to_camera(read(camera)));
    s.camera_changed = true;
    if (s.scene.asks_for_camera()) s.changed = true;  // surfaces look otherwise
  });
}

lumicut_result lumicut_scene_set_trace(lumicut_scene scene, const lumicut_trace* trace) {
  return change_scene(scene, "lumicut_scene_set_trace", [&](lumicut_scene_t& s) {
    s.scene.set_trace(trace == nullptr ? Scene::AccelFactory{} : host_trace(read(trace)));
    s.changed = true;
  });
}

lumicut_result lumicut_scene_commit(lumicut_scene scene) {
  return change_scene(scene, "lumicut_scene_commit", [&](lumicut_scene_t& s) {
    auto stats = std::make_unique<Stats>();
    // Neither trees nor lights depend on the camera.
    if (s.changed) {
      run_work(s.work, [&](Progress& progress) {
        const PhaseTimer timer(*stats, "acceleration structure");
        s.device->arena.run([&] { s.scene.commit(progress); });
      });
      s.changed = false;
    }
    s.camera_changed = false;
    uint64_t instances = 0;
    for (uint32_t m = 0; m < s.scene.meshes().size(); ++m) instances += s.scene.instance_count(m);
    const AccelInfo info = s.scene.accel().info();
    stats->set_value("meshes", static_cast<double>(s.scene.meshes().size()));
    stats->set_value("instances", static_cast<double>(instances));
    stats->set_value("triangles", static_cast<double>(info.triangles));
    stats->set_value("lights", static_cast<double>(s.scene.lights().size()));
    stats->set_value("accel_bytes", static_cast<double>(info.bytes));
    stats->set_value("radius", s.scene.radius());
    s.stats = std::move(stats);
    s.device->log(LogLevel::info, "scene committed: " + number_text(uint64_t{info.triangles}) + " triangles, " +
                                      number_text(instances) + " instances, " +
                                      number_text(uint64_t{s.scene.lights().size()}) + " lights");
  });
}
