// Library, devices, handles, and what every object tells of its work.
#include <cstring>

#include "plugin/check.h"
#include "plugin/descriptors.h"
#include "plugin/extensions.h"
#include "plugin/include/lumicut/lumicut_hits.h"
#include "plugin/include/lumicut/lumicut_lights.h"
#include "plugin/include/lumicut/lumicut_presets.h"
#include "plugin/include/lumicut/lumicut_state.h"
#include "plugin/objects.h"
#include "plugin/render_job.h"

using namespace lumicut;

const char* lumicut_version(uint32_t* abi_major, uint32_t* abi_minor) {
  if (abi_major != nullptr) *abi_major = LUMICUT_ABI_MAJOR;
  if (abi_minor != nullptr) *abi_minor = LUMICUT_ABI_MINOR;
  return LUMICUT_VERSION_TEXT;
}

const char* lumicut_last_error() { return last_error(); }

const void* lumicut_get_extension(const char* id) {
  if (id == nullptr) return nullptr;
  if (std::strcmp(id, LUMICUT_HITS_EXTENSION) == 0) return hits_extension();
  if (std::strcmp(id, LUMICUT_LIGHTS_EXTENSION) == 0) return lights_extension();
  if (std::strcmp(id, LUMICUT_PRESETS_EXTENSION) == 0) return presets_extension();
  if (std::strcmp(id, LUMICUT_STATE_EXTENSION) == 0) return state_extension();
  return nullptr;
}

lumicut_result lumicut_device_create(const lumicut_device_desc* desc, lumicut_device* device) {
  return guard([&] {
    const lumicut_device_desc in = read(desc);
    const FieldValidator c("lumicut_device_desc");
    if (device == nullptr) fail_argument("lumicut_device_create: device is NULL");
    if (in.abi_major != LUMICUT_ABI_MAJOR)
      c.fail_unknown("abi_major", number_text(uint64_t{in.abi_major}) + ", but this library speaks " +
                                      number_text(uint64_t{LUMICUT_ABI_MAJOR}));
    if (in.threads < 0 || in.threads > 1024)
      c.fail("threads", number_text(int64_t{in.threads}) + " is not in [0, 1024]");
    if (in.verbosity < 0 || in.verbosity > 3)
      c.fail("verbosity", number_text(int64_t{in.verbosity}) + " is not in [0, 3]");
    const Log log(in.log, in.user, static_cast<LogLevel>(in.verbosity));
    auto made = std::make_unique<lumicut_device_t>(in.threads, log);
    log(LogLevel::info,
        std::string("Lumicut " LUMICUT_VERSION_TEXT ", ") + number_text(int64_t{made->arena.threads()}) + " threads");
    *device = made.release();
  });
}

void lumicut_retain(void* handle) {
  guard([&] { retain(any_object(handle, "handle")); });
}

void lumicut_release(void* handle) {
  if (handle == nullptr) return;
  guard([&] { release(any_object(handle, "handle")); });
}

namespace {

Work& work_of(Object& o) {
  switch (o.kind) {
    case HandleKind::scene:
      return static_cast<lumicut_scene_t&>(o).work;
    case HandleKind::integrator:
      return static_cast<lumicut_integrator_t&>(o).work;
    case HandleKind::render:
      return static_cast<lumicut_render_t&>(o).work;
    case HandleKind::device:
    case HandleKind::accel:
      break;
  }
  fail_argument(std::string("handle: a ") + handle_name(o.kind) + " has no work of its own");
}

const std::string& stats_of(Object& o) {
  switch (o.kind) {
    case HandleKind::scene: {
      auto& scene = static_cast<lumicut_scene_t&>(o);
      return scene.stats_text = stats_json(scene.work.seconds(), *scene.stats);
    }
    case HandleKind::integrator: {
      auto& integrator = static_cast<lumicut_integrator_t&>(o);
      return integrator.stats_text = stats_json(integrator.work.seconds(), *integrator.stats);
    }
    case HandleKind::render: {
      auto& render = static_cast<lumicut_render_t&>(o);
      return render.stats_text = stats_json(render.work.seconds(), render.stats);
    }
    case HandleKind::accel: {
      auto& accel = static_cast<lumicut_accel_t&>(o);
      const AccelInfo info = accel.accel->info();
      Stats stats;
      stats.add_phase("build", info.build_seconds);
      stats.set_value("primitives", static_cast<double>(info.triangles));
      stats.set_value("nodes", static_cast<double>(info.nodes));
      stats.set_value("bytes", static_cast<double>(info.bytes));
      return accel.stats_text = stats_json(info.build_seconds, stats);
    }
    case HandleKind::device:
      break;
  }
  auto& device = static_cast<lumicut_device_t&>(o);
  Stats stats;
  stats.set_value("threads", device.arena.threads());
  return device.stats_text = stats_json(0.0, stats);
}

}  // namespace

lumicut_result lumicut_get_status(void* handle, lumicut_status* status) {
  return guard([&] {
    Object& o = any_object(handle, "handle");
    if (o.kind == HandleKind::render) return write(status, static_cast<lumicut_render_t&>(o).status());
    if (o.kind == HandleKind::accel) {  // built before its handle is known
      lumicut_status done{};
      done.state = LUMICUT_DONE;
      done.phase = "build";
      done.fraction = 1.0;
      done.seconds = static_cast<lumicut_accel_t&>(o).accel->info().build_seconds;
      return write(status, done);
    }
    write(status, work_of(o).status());
  });
}

lumicut_result lumicut_cancel(void* handle) {
  return guard([&] {
    Object& o = any_object(handle, "handle");
    if (o.kind != HandleKind::accel) work_of(o).cancel();
  });
}

const char* lumicut_stats_json(void* handle) {
  const char* text = nullptr;
  guard([&] { text = stats_of(any_object(handle, "handle")).c_str(); });
  return text;
}
