// Lumicut for C++17 hosts: lumicut.h with counted handles and exceptions, nothing more.
// Handles are values: copying one shares the object, the last one gone releases it. A null handle throws when it is
// used. Ownership, threads, spaces and units are those of lumicut.h.
#ifndef LUMICUT_HPP
#define LUMICUT_HPP

#include <cstdint>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "lumicut.h"

namespace lumicut::api {

class Exception : public std::runtime_error {
 public:
  Exception(lumicut_result code, const std::string& text) : std::runtime_error(text), code_(code) {}
  lumicut_result code() const { return code_; }

 private:
  lumicut_result code_;
};

inline void check(lumicut_result result) {
  if (result != LUMICUT_OK) throw Exception(result, lumicut_last_error());
}

// A descriptor of defaults: make<lumicut_material>().
template <typename T>
T make() {
  T t{};
  t.struct_size = sizeof(T);
  return t;
}

template <typename H>
class Handle {
 public:
  Handle() = default;
  explicit Handle(H owned) : handle_(owned) {}
  Handle(const Handle& o) : handle_(o.handle_) {
    if (handle_ != nullptr) lumicut_retain(handle_);
  }
  Handle(Handle&& o) noexcept : handle_(std::exchange(o.handle_, nullptr)) {}
  Handle& operator=(Handle o) noexcept {
    std::swap(handle_, o.handle_);
    return *this;
  }
  ~Handle() { lumicut_release(handle_); }

  H get() const { return handle_; }
  explicit operator bool() const { return handle_ != nullptr; }

  lumicut_status status() const {
    auto s = make<lumicut_status>();
    check(lumicut_get_status(handle_, &s));
    return s;
  }
  void cancel() const { check(lumicut_cancel(handle_)); }
  std::string stats_json() const {
    const char* text = lumicut_stats_json(handle_);
    if (text == nullptr) throw Exception(LUMICUT_INVALID_ARGUMENT, lumicut_last_error());
    return text;
  }

 private:
  H handle_ = nullptr;
};

class Device : public Handle<lumicut_device> {
 public:
  explicit Device(int threads = 0, void (*log)(void*, int32_t, const char*) = nullptr, void* user = nullptr,
                  int verbosity = 1)
      : Handle(create(threads, log, user, verbosity)) {}

 private:
  static lumicut_device create(int threads, void (*log)(void*, int32_t, const char*), void* user, int verbosity) {
    auto desc = make<lumicut_device_desc>();
    desc.abi_major = LUMICUT_ABI_MAJOR;
    desc.threads = threads;
    desc.verbosity = verbosity;
    desc.log = log;
    desc.user = user;
    lumicut_device device = nullptr;
    check(lumicut_device_create(&desc, &device));
    return device;
  }
};

class Accel : public Handle<lumicut_accel> {
 public:
  Accel(const Device& device, const lumicut_accel_desc& desc) : Handle(build(device, desc)) {}

  lumicut_accel_info info() const {
    auto i = make<lumicut_accel_info>();
    check(lumicut_accel_get_info(get(), &i));
    return i;
  }
  lumicut_accel_node_info node(uint32_t index) const {
    auto n = make<lumicut_accel_node_info>();
    check(lumicut_accel_get_node(get(), index, &n));
    return n;
  }
  void intersect(lumicut_rayhit* rays, uint64_t count) const { check(lumicut_accel_intersect(get(), rays, count)); }
  void occluded(lumicut_ray* rays, uint64_t count) const { check(lumicut_accel_occluded(get(), rays, count)); }

 private:
  static lumicut_accel build(const Device& device, const lumicut_accel_desc& desc) {
    lumicut_accel accel = nullptr;
    check(lumicut_accel_build(device.get(), &desc, &accel));
    return accel;
  }
};

class Scene : public Handle<lumicut_scene> {
 public:
  explicit Scene(const Device& device, const char* accel = nullptr, bool robust = true, const char* builder = nullptr)
      : Handle(create(device, accel, robust, builder)) {}

  void set_textures(const std::vector<lumicut_texture>& t) {
    check(lumicut_scene_set_textures(get(), t.data(), t.size()));
  }
  void set_materials(const std::vector<lumicut_material>& m) {
    check(lumicut_scene_set_materials(get(), m.data(), m.size()));
  }
  uint32_t add_mesh(const lumicut_mesh& mesh) {
    uint32_t id = 0;
    check(lumicut_scene_add_mesh(get(), &mesh, &id));
    return id;
  }
  void update_mesh(uint32_t id, const float* positions, const float* normals, const float* transforms) {
    check(lumicut_scene_update_mesh(get(), id, positions, normals, transforms));
  }
  void set_lights(const std::vector<lumicut_light>& l) { check(lumicut_scene_set_lights(get(), l.data(), l.size())); }
  void set_profiles(const std::vector<lumicut_profile>& p) {
    check(lumicut_scene_set_profiles(get(), p.data(), p.size()));
  }
  void set_environment(const lumicut_environment& e) { check(lumicut_scene_set_environment(get(), &e)); }
  void clear_environment() { check(lumicut_scene_set_environment(get(), nullptr)); }
  void set_camera(const lumicut_camera& camera) { check(lumicut_scene_set_camera(get(), &camera)); }
  void set_trace(const lumicut_trace& trace) { check(lumicut_scene_set_trace(get(), &trace)); }
  void clear_trace() { check(lumicut_scene_set_trace(get(), nullptr)); }
  void commit() { check(lumicut_scene_commit(get())); }

 private:
  static lumicut_scene create(const Device& device, const char* accel, bool robust, const char* builder) {
    auto desc = make<lumicut_scene_desc>();
    desc.robust = robust ? LUMICUT_ROBUST : LUMICUT_FAST;
    desc.accel = accel;
    desc.builder = builder;
    lumicut_scene scene = nullptr;
    check(lumicut_scene_create(device.get(), &desc, &scene));
    return scene;
  }
};

class Integrator : public Handle<lumicut_integrator> {
 public:
  Integrator(const Device& device, const char* id) : Handle(create(device, id)) {}

  Integrator& set(const char* name, const std::string& value) {
    check(lumicut_integrator_set(get(), name, value.c_str()));
    return *this;
  }
  std::string value(const char* name) const {
    const char* text = lumicut_integrator_get(get(), name);
    if (text == nullptr) throw Exception(LUMICUT_INVALID_ARGUMENT, lumicut_last_error());
    return text;
  }
  void set_lights(const std::vector<lumicut_vpl>& l) {
    check(lumicut_integrator_set_lights(get(), l.data(), l.size()));
  }
  void prepare(const Scene& scene) { check(lumicut_integrator_prepare(get(), scene.get())); }
  std::vector<lumicut_vpl> lights() const {
    const lumicut_vpl* view = nullptr;
    uint64_t count = 0;
    check(lumicut_integrator_get_lights(get(), &view, &count));
    return {view, view + count};
  }
  // Three floats a point.
  std::vector<float> shade(const std::vector<lumicut_point>& points) const {
    std::vector<float> radiance(3 * points.size());
    check(lumicut_integrator_shade(get(), points.data(), points.size(), radiance.data()));
    return radiance;
  }

 private:
  static lumicut_integrator create(const Device& device, const char* id) {
    lumicut_integrator integrator = nullptr;
    check(lumicut_integrator_create(device.get(), id, &integrator));
    return integrator;
  }
};

// Starts at once; the last handle gone cancels it.
class Render : public Handle<lumicut_render> {
 public:
  Render(const Integrator& integrator, const Scene& scene, const lumicut_render_desc& desc)
      : Handle(start(integrator, scene, desc)), desc_(desc) {}

  // Throws what made the render fail, also LUMICUT_CANCELLED.
  lumicut_status wait(uint32_t milliseconds = LUMICUT_FOREVER) const {
    auto s = make<lumicut_status>();
    check(lumicut_render_wait(get(), milliseconds, &s));
    return s;
  }
  // False: none now.
  bool next_tile(lumicut_tile& tile) const {
    tile.struct_size = sizeof(tile);
    check(lumicut_render_next_tile(get(), &tile));
    return tile.x1 != 0;
  }
  // The crop, rows packed from the top.
  std::vector<float> read(const char* channel) const {
    const bool whole = desc_.crop[2] == 0;
    const uint64_t width = whole ? desc_.width : desc_.crop[2] - desc_.crop[0];
    const uint64_t height = whole ? desc_.height : desc_.crop[3] - desc_.crop[1];
    std::vector<float> out(width * height * components(channel));
    check(lumicut_render_read(get(), channel, nullptr, out.data()));
    return out;
  }

 private:
  static lumicut_render start(const Integrator& integrator, const Scene& scene, const lumicut_render_desc& desc) {
    lumicut_render render = nullptr;
    check(lumicut_render_start(integrator.get(), scene.get(), &desc, &render));
    return render;
  }
  // 3 for a name that does not exist: the read that follows says so.
  static uint64_t components(const std::string& channel) {
    auto info = make<lumicut_channel_info>();
    for (uint32_t i = 0; lumicut_get_channel_info(i, &info) == LUMICUT_OK; ++i)
      if (channel == info.name) return info.components;
    return 3;
  }
  lumicut_render_desc desc_;
};

}  // namespace lumicut::api

#endif  // LUMICUT_HPP
