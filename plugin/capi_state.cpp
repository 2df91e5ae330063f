// Extension "lumicut.state/1": what an integrator prepared, as bytes. The format is in docs/integrators/wspd.md.
#include <cstring>

#include "lights/trace_vpls.h"
#include "plugin/check.h"
#include "plugin/convert.h"
#include "plugin/extensions.h"
#include "plugin/include/lumicut/lumicut_state.h"
#include "plugin/objects.h"
#include "render/identity.h"

using namespace lumicut;

namespace {

constexpr char kMagic[8] = {'L', 'U', 'M', 'I', 'C', 'U', 'T', 'S'};
constexpr char kIntegrator[] = "integrator";
constexpr uint32_t kVersion = 6, kByteOrder = 0x01020304u;
// Of a light that stands for a place of a lamp, what no host needs to know.
struct Lamp {
  Vec3f from_centre;
  float radius;
  uint32_t facing, ray_mask;
};
constexpr uint64_t kLightBytes = sizeof(lumicut_vpl) + sizeof(lumicut_vpl_origin) + sizeof(Lamp);

std::vector<Lamp> lamps_of(const VplSet& set) {
  std::vector<Lamp> lamps(set.lights.size());
  for (size_t i = 0; i < lamps.size(); ++i) {
    const Vpl& v = set.lights[i];
    lamps[i] = {v.from_centre, v.lamp_radius, v.facing ? 1u : 0u, v.ray_mask};
  }
  return lamps;
}

// Lights keep their order: those of emitters were first when they were saved.
void take_lamps(const std::vector<Lamp>& lamps, VplSet& set) {
  for (size_t i = 0; i < lamps.size(); ++i) {
    const Lamp& lamp = lamps[i];
    Vpl& v = set.lights[i];
    if (!is_finite(lamp.from_centre) || !(lamp.radius >= 0.0f) || std::isinf(lamp.radius) || lamp.facing > 1)
      fail_argument("lamp " + number_text(uint64_t{i}) + " is none");
    v.from_centre = lamp.from_centre, v.lamp_radius = lamp.radius, v.facing = lamp.facing != 0,
    v.ray_mask = lamp.ray_mask;
  }
}

// Followed by what it was made for as text, the lights, their origins, and the method's own bytes.
struct Header {
  char magic[8];
  uint32_t version, byte_order;
  uint64_t size;      // of all
  uint64_t checksum;  // of the header with 0 here, and of all that follows it
  uint64_t lights, light_paths, emitter_samples;
  uint64_t method_bytes;
  uint32_t key_bytes, host_lights;
};
static_assert(sizeof(Header) == 72);

uint64_t checksum(Header h, const uint8_t* body, size_t size) {
  h.checksum = 0;
  return hash_bytes(hash_bytes(0, &h, sizeof(h)), body, size);
}

// Of all that lights and structures depend on: any camera may look at them.
std::string state_key(const lumicut_integrator_t& i, const Params& params, const Scene& scene) {
  Identity key;
  key.add(kIntegrator, std::string(i.entry.id));
  key.add(params);
  key.add(scene, false);
  return key.text();
}

// A state serves all cameras.
void require_lights_for_all(const Params& params) {
  if (params.common().importance)
    fail_argument(
        "parameter importance: it puts virtual lights where one camera sees them, and a saved state serves all "
        "cameras");
}

std::vector<uint8_t> save(lumicut_integrator_t& i) {
  if (i.prepared == nullptr) fail_state("lumicut_integrator: nothing is prepared, so nothing can be saved");
  const Prepared& p = *i.prepared;
  require_lights_for_all(*p.params);
  lumicut_scene_t& s = i.prepared_scene();
  const AccessGuard::Hold reading = s.gate.read("lumicut_state_extension.save");
  if (s.changed || p.scene_version != s.scene.version())
    fail_state("lumicut_integrator: its scene was changed since it was prepared");
  const std::vector<uint8_t> own = p.method->save_state();
  const std::string key = state_key(i, *p.params, s.scene);
  const HostVpls lights = from_vpls(*p.vpls);
  Header h{};
  std::memcpy(h.magic, kMagic, sizeof(kMagic));
  h.version = kVersion, h.byte_order = kByteOrder;
  h.lights = lights.lights.size(), h.light_paths = lights.light_paths, h.emitter_samples = lights.emitter_samples;
  h.method_bytes = own.size();
  h.key_bytes = static_cast<uint32_t>(key.size());
  h.host_lights = p.host_lights != 0 ? 1 : 0;
  h.size = sizeof(Header) + key.size() + h.lights * kLightBytes + own.size();
  std::vector<uint8_t> out(h.size);
  uint8_t* at = out.data() + sizeof(h);
  const auto append = [&](const void* data, size_t size) {
    if (size > 0) std::memcpy(at, data, size);
    at += size;
  };
  append(key.data(), key.size());
  append(lights.lights.data(), h.lights * sizeof(lumicut_vpl));
  append(lights.origins.data(), h.lights * sizeof(lumicut_vpl_origin));
  append(lamps_of(*p.vpls).data(), h.lights * sizeof(Lamp));
  append(own.data(), own.size());
  h.checksum = checksum(h, out.data() + sizeof(h), out.size() - sizeof(h));
  std::memcpy(out.data(), &h, sizeof(h));
  return out;
}

[[noreturn]] void fail_bytes(const std::string& what) { fail_argument("state: " + what); }

void load(lumicut_integrator_t& i, lumicut_scene_t& s, const uint8_t* bytes, uint64_t size, Progress& progress,
          Stats& stats) {
  require_lights_for_all(i.params);
  Header h;
  if (size < sizeof(h)) fail_bytes(number_text(size) + " bytes are too few");
  std::memcpy(&h, bytes, sizeof(h));
  if (std::memcmp(h.magic, kMagic, sizeof(kMagic)) != 0) fail_bytes("these bytes are no saved state");
  if (h.byte_order != kByteOrder) fail_bytes("it was saved on a machine of another byte order");
  if (h.version != kVersion)
    fail_bytes("it has version " + number_text(uint64_t{h.version}) + ", this library reads " +
               number_text(uint64_t{kVersion}));
  if (h.size != size)
    fail_bytes("it is " + number_text(size) + " bytes long instead of " + number_text(h.size) + ": cut or joined");
  uint64_t left = size - sizeof(h);
  const auto take = [&](uint64_t count, uint64_t each) {
    if (count > left / each) fail_bytes("its parts are longer than it is: damaged");
    left -= count * each;
  };
  take(h.key_bytes, 1), take(h.lights, kLightBytes), take(h.method_bytes, 1);
  const uint8_t* at = bytes + sizeof(h);
  if (left != 0 || checksum(h, at, size - sizeof(h)) != h.checksum) fail_bytes("its checksum is wrong: damaged");

  const std::string made_for(reinterpret_cast<const char*>(at), h.key_bytes);
  if (const auto differs = difference(made_for, state_key(i, i.params, s.scene))) {
    if (differs->name == kIntegrator)
      fail_bytes("it is of \"" + differs->saved + "\", not of \"" + differs->now + "\"");
    fail_bytes("it was made for a scene of other geometry, materials or lights, or with other parameters: " +
               differs->text());
  }
  at += h.key_bytes;
  // Lights of a file are checked as those of a host are.
  HostVpls saved;
  const auto read = [&](auto& array) {
    array.resize(h.lights);
    if (h.lights > 0) std::memcpy(array.data(), at, h.lights * sizeof(array[0]));
    at += h.lights * sizeof(array[0]);
  };
  std::vector<Lamp> lamps;
  read(saved.lights), read(saved.origins), read(lamps);
  saved.light_paths = h.light_paths, saved.emitter_samples = h.emitter_samples;
  std::shared_ptr<VplSet> vpls;
  try {
    vpls = std::make_shared<VplSet>(to_vpls(saved.view(), s.scene.profiles()));
    take_lamps(lamps, *vpls);
  } catch (const Error& error) {
    fail_bytes(std::string("a light in it makes no sense: ") + error.what());
  }

  auto next = std::make_unique<Prepared>();
  next->scene = &s.scene;
  next->scene_owner = owner_of(s);
  next->scene_version = s.scene.version();
  next->params_key = i.params.all_texts();
  next->vpls_key = tracing_key(vpl_options(i.params.common()));
  next->host_lights = h.host_lights != 0 ? i.host_lights_sets + 1 : 0;
  next->params = i.params;
  next->vpls = vpls;
  next->place_lights(i.entry.light_source, progress);
  next->method = i.entry.create();
  next->method->load_state(s.scene, next->standing_off, *next->params, {at, h.method_bytes}, {progress, stats});
  stats.set_value("vpls", static_cast<double>(vpls->lights.size()));
  stats.set_value("light_paths", static_cast<double>(h.light_paths));
  // From here nothing fails.
  i.host_lights = h.host_lights != 0 ? std::shared_ptr<const VplSet>(vpls) : nullptr;
  i.host_lights_id = next->host_lights;
  if (h.host_lights != 0) ++i.host_lights_sets;
  i.prepared = std::move(next);
}

lumicut_result save_state(lumicut_integrator integrator, void* bytes, uint64_t* size) {
  return guard([&] {
    lumicut_integrator_t& i = object(integrator);
    const AccessGuard::Hold hold = i.gate.change("lumicut_state_extension.save");
    if (size == nullptr) fail_argument("lumicut_state_extension.save: size is NULL");
    const std::vector<uint8_t> state = i.device->arena.run([&] { return save(i); });
    if (bytes != nullptr) {
      if (*size < state.size())
        fail_argument("lumicut_state_extension.save: size: " + number_text(*size) + " bytes are less than " +
                      number_text(uint64_t{state.size()}));
      std::memcpy(bytes, state.data(), state.size());
    }
    *size = state.size();
  });
}

lumicut_result load_state(lumicut_integrator integrator, lumicut_scene scene, const void* bytes, uint64_t size) {
  return guard([&] {
    lumicut_integrator_t& i = object(integrator);
    lumicut_scene_t& s = object(scene);
    const AccessGuard::Hold changing = i.gate.change("lumicut_state_extension.load");
    const AccessGuard::Hold reading = s.gate.read("lumicut_state_extension.load");
    s.require_committed();
    if (s.device.get() != i.device.get())
      fail_argument("lumicut_scene: it belongs to another device than the integrator");
    if (bytes == nullptr) fail_argument("lumicut_state_extension.load: bytes is NULL");
    auto stats = std::make_unique<Stats>();
    run_work(i.work, [&](Progress& progress) {
      i.device->arena.run([&] { load(i, s, static_cast<const uint8_t*>(bytes), size, progress, *stats); });
    });
    i.stats = std::move(stats);
  });
}

const lumicut_state_extension kTable = {sizeof(lumicut_state_extension), 0, save_state, load_state};

}  // namespace

namespace lumicut {

const void* state_extension() { return &kTable; }

}  // namespace lumicut
