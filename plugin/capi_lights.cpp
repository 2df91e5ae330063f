// Virtual lights in and out: of lumicut.h, and with their origins by the extension "lumicut.lights/1".
#include <algorithm>

#include "lights/light_reach.h"
#include "plugin/descriptors.h"
#include "plugin/extensions.h"
#include "plugin/objects.h"

using namespace lumicut;

namespace lumicut {

template <>
struct Descriptor<lumicut_vpl_set> {
  using S = lumicut_vpl_set;
  static constexpr const char* name = "lumicut_vpl_set";
  // NOLINTBEGIN(bugprone-sizeof-expression): the sizes of the pointers are meant
  static constexpr FieldSpan fields[] = {
      {offsetof(S, struct_size), sizeof(S::struct_size)},
      {offsetof(S, reserved), sizeof(S::reserved)},
      {offsetof(S, count), sizeof(S::count)},
      {offsetof(S, lights), sizeof(S::lights)},
      {offsetof(S, origins), sizeof(S::origins)},
      {offsetof(S, light_paths), sizeof(S::light_paths)},
      {offsetof(S, emitter_samples), sizeof(S::emitter_samples)},
  };
  // NOLINTEND(bugprone-sizeof-expression)
  static_assert(fields_fill(fields, sizeof(S)));
};

}  // namespace lumicut

namespace {

void set(lumicut_integrator integrator, const lumicut_vpl_set& lights, const char* user) {
  lumicut_integrator_t& i = object(integrator);
  const AccessGuard::Hold hold = i.gate.change(user);
  if (lights.count == 0) {
    i.host_lights.reset();
    i.host_lights_id = 0;
    return;
  }
  i.host_lights = std::make_shared<const VplSet>(to_vpls(lights));
  i.host_lights_id = ++i.host_lights_sets;
}

const HostVpls& prepared(lumicut_integrator integrator, const char* user) {
  lumicut_integrator_t& i = object(integrator);
  const AccessGuard::Hold hold = i.gate.read(user);
  if (i.prepared == nullptr) fail_state("lumicut_integrator: it is not prepared");
  return i.prepared_lights();
}

lumicut_result get_set(lumicut_integrator integrator, lumicut_vpl_set* lights) {
  return guard([&] {
    object(integrator);
    if (lights == nullptr) fail_argument("lumicut_vpl_set: is NULL");
    // What another render would take them for: samples of emitters by power.
    if (const Prepared* p = object(integrator).prepared.get(); p != nullptr && p->importance != nullptr)
      fail_argument(
          "parameter importance: these virtual lights were put where one camera sees them, and their origins tell "
          "nothing of its chances; lumicut_integrator_get_lights gives them without");
    if (const Prepared* p = object(integrator).prepared.get();
        p != nullptr && !std::all_of(p->vpls->lights.begin(), p->vpls->lights.end(), lights_all))
      fail_argument(
          "lumicut_vpl_set: some lamps of the scene light only kinds of lobes or sets of meshes (lumicut_light.mask, "
          "receivers), which virtual lights do not tell");
    write(lights, prepared(integrator, "lumicut_lights_extension.get").view());
  });
}

lumicut_result set_set(lumicut_integrator integrator, const lumicut_vpl_set* lights) {
  return guard([&] {
    object(integrator);
    set(integrator, read(lights), "lumicut_lights_extension.set");
  });
}

const lumicut_lights_extension kTable = {sizeof(lumicut_lights_extension), 0, get_set, set_set};

}  // namespace

namespace lumicut {

const void* lights_extension() { return &kTable; }

}  // namespace lumicut

lumicut_result lumicut_integrator_set_lights(lumicut_integrator integrator, const lumicut_vpl* lights, uint64_t count) {
  return guard([&] {
    lumicut_vpl_set bare{};
    bare.count = count, bare.lights = lights;
    set(integrator, bare, "lumicut_integrator_set_lights");
  });
}

lumicut_result lumicut_integrator_get_lights(lumicut_integrator integrator, const lumicut_vpl** lights,
                                             uint64_t* count) {
  return guard([&] {
    object(integrator);
    if (lights == nullptr || count == nullptr) fail_argument("lumicut_integrator_get_lights: lights or count is NULL");
    const HostVpls& shown = prepared(integrator, "lumicut_integrator_get_lights");
    *lights = shown.lights.data();
    *count = shown.lights.size();
  });
}
