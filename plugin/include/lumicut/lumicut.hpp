// Lumicut for C++17 hosts: all of lumicut.h and lumicut_lights.h with counted handles, exceptions and arrays that know
// their length.
//
// Handles are values: copying one shares the object, the last one gone releases it. A null handle throws when it is
// used. Ownership, threads, spaces and units are those of lumicut.h.
//
// Functions come from a table. A program that links the library passes none and gets linked(); one that loads it makes
// a table with load() and passes it to Device, which hands it on to what is made from it. The table outlives them all.
#ifndef LUMICUT_HPP
#define LUMICUT_HPP

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "lumicut.h"
#include "lumicut_lights.h"

// Every function of lumicut.h, without "lumicut_".
// clang-format off
#define LUMICUT_FOR_ALL_FUNCTIONS(X)                                                                                   \
  X(version) X(last_error) X(device_create) X(retain) X(release)                                                       \
  X(scene_create) X(scene_set_materials) X(scene_add_mesh) X(scene_set_lights) X(scene_set_camera) X(scene_commit)     \
  X(integrator_create) X(integrator_set) X(integrator_get)                                                             \
  X(render_start) X(render_wait) X(render_read) X(render_next_tile) X(render_groups) X(render_checkpoint)              \
  X(get_status) X(cancel) X(stats_json)                                                                                \
  X(scene_set_textures) X(scene_set_profiles) X(scene_set_environment) X(scene_update_mesh)                            \
  X(get_integrator_info) X(get_param_info) X(get_channel_info) X(get_extension)                                        \
  X(integrator_set_lights) X(integrator_prepare) X(integrator_get_lights) X(integrator_shade)                          \
  X(scene_set_trace) X(accel_build) X(accel_get_info) X(accel_get_node) X(accel_get_primitives) X(accel_intersect)     \
  X(accel_occluded)
// clang-format on

namespace lumicut::api {

// ---- Functions and errors ------------------------------------------------------------------------------------------

struct Functions {
#define LUMICUT_MEMBER(name) decltype(&lumicut_##name) name = nullptr;
  LUMICUT_FOR_ALL_FUNCTIONS(LUMICUT_MEMBER)
#undef LUMICUT_MEMBER
};

// Of the library that the program links. Needs it only where it is called.
inline const Functions& linked() {
#define LUMICUT_ADDRESS(name) &lumicut_##name,
  static const Functions functions = {LUMICUT_FOR_ALL_FUNCTIONS(LUMICUT_ADDRESS)};
#undef LUMICUT_ADDRESS
  return functions;
}

class Exception : public std::runtime_error {
 public:
  Exception(lumicut_result code, const std::string& text) : std::runtime_error(text), code_(code) {}
  lumicut_result code() const { return code_; }

 private:
  lumicut_result code_;
};

// Throws Exception with the library's text, after "<doing>: " where that is given.
inline void check(const Functions& f, lumicut_result result, const std::string& doing = {}) {
  if (result == LUMICUT_OK) return;
  const char* text = f.last_error();
  std::string all = text != nullptr && *text != 0 ? text : "failed with code " + std::to_string(result);
  if (!doing.empty()) all.insert(0, doing + ": ");
  throw Exception(result, all);
}
inline void check(lumicut_result result) { check(linked(), result); }

// The table of a library that is loaded. `find` is called with a function's whole name and gives its address, as dlsym
// and GetProcAddress do. Throws Exception(LUMICUT_UNSUPPORTED) where the library lacks a function or has another
// LUMICUT_ABI_MAJOR.
template <typename Find>
Functions load(Find&& find) {
  Functions f;
  const auto need = [&](auto& function, const char* name) {
    function = reinterpret_cast<std::remove_reference_t<decltype(function)>>(find(name));
    if (function == nullptr) throw Exception(LUMICUT_UNSUPPORTED, std::string("lacks the function ") + name);
  };
#define LUMICUT_LOAD(name) need(f.name, "lumicut_" #name);
  LUMICUT_FOR_ALL_FUNCTIONS(LUMICUT_LOAD)
#undef LUMICUT_LOAD
  uint32_t major = 0, minor = 0;
  f.version(&major, &minor);
  if (major != LUMICUT_ABI_MAJOR)
    throw Exception(LUMICUT_UNSUPPORTED, "has version " + std::to_string(major) + "." + std::to_string(minor) +
                                             " of the ABI; " + std::to_string(LUMICUT_ABI_MAJOR) + " is needed");
  return f;
}

// ---- Values --------------------------------------------------------------------------------------------------------

// A descriptor of defaults: make<lumicut_material>().
template <typename T>
T make() {
  T t{};
  t.struct_size = sizeof(T);
  return t;
}

// An array that belongs to somebody else: made from what has data() and size(), from {a, b}, or from an array.
template <typename T>
class Span {
 public:
  constexpr Span() = default;
  constexpr Span(T* data, size_t size) : data_(data), size_(size) {}
  template <size_t N>
  constexpr Span(T (&array)[N]) : data_(array), size_(N) {}
  template <typename U, typename = std::enable_if_t<std::is_same_v<const U, T>>>
  constexpr Span(std::initializer_list<U> list) : Span(list.begin(), list.size()) {}
  template <typename C, typename P = decltype(std::declval<C&>().data()),
            typename = decltype(std::declval<C&>().size()),
            typename = std::enable_if_t<std::is_convertible_v<std::remove_pointer_t<P> (*)[], T (*)[]>>>
  constexpr Span(C&& container) : data_(container.data()), size_(container.size()) {}

  constexpr T* data() const { return data_; }
  constexpr size_t size() const { return size_; }
  constexpr bool empty() const { return size_ == 0; }
  constexpr T* begin() const { return data_; }
  constexpr T* end() const { return data_ + size_; }
  constexpr T& operator[](size_t i) const { return data_[i]; }

 private:
  T* data_ = nullptr;
  size_t size_ = 0;
};

struct Version {
  std::string text;  // "major.minor.patch"
  uint32_t abi_major = 0, abi_minor = 0;
};

inline Version version(const Functions& f = linked()) {
  Version v;
  v.text = f.version(&v.abi_major, &v.abi_minor);
  return v;
}

// ---- What the library offers ---------------------------------------------------------------------------------------

// The texts last as long as the library.
inline std::vector<lumicut_integrator_info> integrators(const Functions& f = linked()) {
  std::vector<lumicut_integrator_info> all;
  for (auto info = make<lumicut_integrator_info>();
       f.get_integrator_info(static_cast<uint32_t>(all.size()), &info) == LUMICUT_OK;)
    all.push_back(info);
  return all;
}

inline std::vector<lumicut_param_info> params(const std::string& integrator, const Functions& f = linked()) {
  std::vector<lumicut_param_info> all;
  for (auto info = make<lumicut_param_info>();
       f.get_param_info(integrator.c_str(), static_cast<uint32_t>(all.size()), &info) == LUMICUT_OK;)
    all.push_back(info);
  return all;
}

inline std::vector<lumicut_channel_info> channels(const Functions& f = linked()) {
  std::vector<lumicut_channel_info> all;
  for (auto info = make<lumicut_channel_info>();
       f.get_channel_info(static_cast<uint32_t>(all.size()), &info) == LUMICUT_OK;)
    all.push_back(info);
  return all;
}

// nullptr: the library has no such extension. T is its table, such as lumicut_state_extension.
template <typename T>
const T* extension(const char* id, const Functions& f = linked()) {
  return static_cast<const T*>(f.get_extension(id));
}

// Virtual lights with what is known of where they come from.
struct VplSet {
  std::vector<lumicut_vpl> lights;
  std::vector<lumicut_vpl_origin> origins;  // as many, or none: nothing is known
  uint64_t light_paths = 0, emitter_samples = 0;
};

// Throws Exception(LUMICUT_UNSUPPORTED) where the library has no extension "lumicut.lights/1".
inline const lumicut_lights_extension& lights_extension(const Functions& f = linked()) {
  const auto* table = extension<lumicut_lights_extension>(LUMICUT_LIGHTS_EXTENSION, f);
  if (table == nullptr) throw Exception(LUMICUT_UNSUPPORTED, "lacks the extension " LUMICUT_LIGHTS_EXTENSION);
  return *table;
}

// The texts of errors begin as those of check().
inline VplSet get_vpls(lumicut_integrator integrator, const Functions& f = linked(), const std::string& doing = {}) {
  auto view = make<lumicut_vpl_set>();
  check(f, lights_extension(f).get(integrator, &view), doing);
  return {{view.lights, view.lights + view.count},
          {view.origins, view.origins + view.count},
          view.light_paths,
          view.emitter_samples};
}
inline void set_vpls(lumicut_integrator integrator, const VplSet& set, const Functions& f = linked(),
                     const std::string& doing = {}) {
  if (!set.origins.empty() && set.origins.size() != set.lights.size())
    throw Exception(LUMICUT_INVALID_ARGUMENT, "origins: " + std::to_string(set.origins.size()) + " of " +
                                                  std::to_string(set.lights.size()) + " lights");
  auto view = make<lumicut_vpl_set>();
  view.count = set.lights.size(), view.lights = set.lights.data();
  if (!set.origins.empty()) view.origins = set.origins.data();
  view.light_paths = set.light_paths, view.emitter_samples = set.emitter_samples;
  check(f, lights_extension(f).set(integrator, &view), doing);
}

// ---- Handles -------------------------------------------------------------------------------------------------------

template <typename H>
class Handle {
 public:
  Handle() = default;
  explicit Handle(const Functions& f) : functions_(&f) {}  // null, to be filled through out()
  explicit Handle(H owned, const Functions& f = linked()) : functions_(&f), handle_(owned) {}
  Handle(const Handle& o) : functions_(o.functions_), handle_(o.handle_) {
    if (handle_ != nullptr) functions_->retain(handle_);
  }
  Handle(Handle&& o) noexcept : functions_(o.functions_), handle_(std::exchange(o.handle_, nullptr)) {}
  Handle& operator=(Handle o) noexcept {
    std::swap(functions_, o.functions_);
    std::swap(handle_, o.handle_);
    return *this;
  }
  ~Handle() { reset(); }

  H get() const { return handle_; }
  explicit operator bool() const { return handle_ != nullptr; }
  void reset() {
    if (handle_ != nullptr) functions_->release(std::exchange(handle_, nullptr));
  }
  // For a function of lumicut.h that creates. Releases what was held.
  H* out() {
    reset();
    return &handle_;
  }
  // Throws where the handle is null.
  const Functions& functions() const {
    if (functions_ == nullptr || handle_ == nullptr) throw Exception(LUMICUT_INVALID_ARGUMENT, "handle: is NULL");
    return *functions_;
  }

  lumicut_status status() const {
    auto s = make<lumicut_status>();
    check(functions(), functions().get_status(handle_, &s));
    return s;
  }
  void cancel() const { check(functions(), functions().cancel(handle_)); }
  std::string stats_json() const {
    const char* text = functions().stats_json(handle_);
    if (text == nullptr) throw Exception(LUMICUT_INVALID_ARGUMENT, functions().last_error());
    return text;
  }

 private:
  const Functions* functions_ = nullptr;
  H handle_ = nullptr;
};

class Device : public Handle<lumicut_device> {
 public:
  using Log = void (*)(void* user, int32_t level, const char* text);

  explicit Device(int threads = 0, Log log = nullptr, void* user = nullptr, int verbosity = 1)
      : Device(linked(), threads, log, user, verbosity) {}
  explicit Device(const Functions& f, int threads = 0, Log log = nullptr, void* user = nullptr, int verbosity = 1)
      : Handle(f) {
    auto desc = make<lumicut_device_desc>();
    desc.abi_major = LUMICUT_ABI_MAJOR;
    desc.threads = threads;
    desc.verbosity = verbosity;
    desc.log = log;
    desc.user = user;
    check(f, f.device_create(&desc, out()));
  }
};

class Accel : public Handle<lumicut_accel> {
 public:
  Accel(const Device& device, const lumicut_accel_desc& desc) : Handle(device.functions()) {
    const Functions& f = device.functions();
    check(f, f.accel_build(device.get(), &desc, out()));
  }

  lumicut_accel_info info() const {
    auto i = make<lumicut_accel_info>();
    check(functions(), functions().accel_get_info(get(), &i));
    return i;
  }
  lumicut_accel_node_info node(uint32_t index) const {
    auto n = make<lumicut_accel_node_info>();
    check(functions(), functions().accel_get_node(get(), index, &n));
    return n;
  }
  // Leaf order -> primitive. Lasts as long as the accel.
  Span<const uint32_t> primitives() const {
    const uint32_t* ids = nullptr;
    uint64_t count = 0;
    check(functions(), functions().accel_get_primitives(get(), &ids, &count));
    return {ids, static_cast<size_t>(count)};
  }
  void intersect(Span<lumicut_rayhit> rays) const {
    check(functions(), functions().accel_intersect(get(), rays.data(), rays.size()));
  }
  void intersect(lumicut_rayhit* rays, uint64_t count) const { intersect({rays, static_cast<size_t>(count)}); }
  void occluded(Span<lumicut_ray> rays) const {
    check(functions(), functions().accel_occluded(get(), rays.data(), rays.size()));
  }
  void occluded(lumicut_ray* rays, uint64_t count) const { occluded({rays, static_cast<size_t>(count)}); }
};

class Scene : public Handle<lumicut_scene> {
 public:
  explicit Scene(const Device& device, const char* accel = nullptr, bool robust = true, const char* builder = nullptr)
      : Handle(device.functions()) {
    auto desc = make<lumicut_scene_desc>();
    desc.robust = robust ? LUMICUT_ROBUST : LUMICUT_FAST;
    desc.accel = accel;
    desc.builder = builder;
    const Functions& f = device.functions();
    check(f, f.scene_create(device.get(), &desc, out()));
  }

  void set_textures(Span<const lumicut_texture> t) {
    check(functions(), functions().scene_set_textures(get(), t.data(), t.size()));
  }
  void set_materials(Span<const lumicut_material> m) {
    check(functions(), functions().scene_set_materials(get(), m.data(), m.size()));
  }
  uint32_t add_mesh(const lumicut_mesh& mesh) {
    uint32_t id = 0;
    check(functions(), functions().scene_add_mesh(get(), &mesh, &id));
    return id;
  }
  void update_mesh(uint32_t id, const float* positions, const float* normals, const float* transforms) {
    check(functions(), functions().scene_update_mesh(get(), id, positions, normals, transforms));
  }
  void set_lights(Span<const lumicut_light> l) {
    check(functions(), functions().scene_set_lights(get(), l.data(), l.size()));
  }
  void set_profiles(Span<const lumicut_profile> p) {
    check(functions(), functions().scene_set_profiles(get(), p.data(), p.size()));
  }
  void set_environment(const lumicut_environment& e) {
    check(functions(), functions().scene_set_environment(get(), &e));
  }
  void clear_environment() { check(functions(), functions().scene_set_environment(get(), nullptr)); }
  void set_camera(const lumicut_camera& camera) { check(functions(), functions().scene_set_camera(get(), &camera)); }
  void set_trace(const lumicut_trace& trace) { check(functions(), functions().scene_set_trace(get(), &trace)); }
  void clear_trace() { check(functions(), functions().scene_set_trace(get(), nullptr)); }
  void commit() { check(functions(), functions().scene_commit(get())); }
};

class Integrator : public Handle<lumicut_integrator> {
 public:
  Integrator(const Device& device, const char* id) : Handle(device.functions()) {
    const Functions& f = device.functions();
    check(f, f.integrator_create(device.get(), id, out()));
  }

  Integrator& set(const char* name, const std::string& value) {
    check(functions(), functions().integrator_set(get(), name, value.c_str()));
    return *this;
  }
  // Of lumicut_integrator_info, such as `good`: "name=value name=value". NULL sets nothing.
  Integrator& apply(const char* preset) {
    std::string rest = preset != nullptr ? preset : "";
    while (!rest.empty()) {
      const std::string pair = rest.substr(0, rest.find(' '));
      rest.erase(0, pair.size() + 1);
      const size_t equals = pair.find('=');
      if (equals == std::string::npos) throw Exception(LUMICUT_INVALID_ARGUMENT, "preset: \"" + pair + "\" has no =");
      set(pair.substr(0, equals).c_str(), pair.substr(equals + 1));
    }
    return *this;
  }
  std::string value(const char* name) const {
    const char* text = functions().integrator_get(get(), name);
    if (text == nullptr) throw Exception(LUMICUT_INVALID_ARGUMENT, functions().last_error());
    return text;
  }
  void set_lights(Span<const lumicut_vpl> l) {
    check(functions(), functions().integrator_set_lights(get(), l.data(), l.size()));
  }
  void prepare(const Scene& scene) { check(functions(), functions().integrator_prepare(get(), scene.get())); }
  std::vector<lumicut_vpl> lights() const {
    const Span<const lumicut_vpl> view = lights_view();
    return {view.begin(), view.end()};
  }
  // Lasts until the next call that is not [any].
  Span<const lumicut_vpl> lights_view() const {
    const lumicut_vpl* view = nullptr;
    uint64_t count = 0;
    check(functions(), functions().integrator_get_lights(get(), &view, &count));
    return {view, static_cast<size_t>(count)};
  }
  // Lights together with their origins: those that go out and come in again render the same image.
  VplSet vpls() const { return get_vpls(get(), functions()); }
  void set_vpls(const VplSet& set) { api::set_vpls(get(), set, functions()); }
  // Three floats a point.
  std::vector<float> shade(Span<const lumicut_point> points) const {
    std::vector<float> radiance(3 * points.size());
    shade(points, radiance);
    return radiance;
  }
  void shade(Span<const lumicut_point> points, Span<float> radiance) const {
    if (radiance.size() < 3 * points.size())
      throw Exception(LUMICUT_INVALID_ARGUMENT, "radiance: has room for " + std::to_string(radiance.size() / 3) +
                                                    " of " + std::to_string(points.size()) + " points");
    check(functions(), functions().integrator_shade(get(), points.data(), points.size(), radiance.data()));
  }
};

// Starts at once; the last handle gone cancels it.
class Render : public Handle<lumicut_render> {
 public:
  Render(const Integrator& integrator, const Scene& scene, const lumicut_render_desc& desc)
      : Handle(integrator.functions()), desc_(desc) {
    const Functions& f = integrator.functions();
    check(f, f.render_start(integrator.get(), scene.get(), &desc, out()));
  }

  // Throws what made the render fail, also LUMICUT_CANCELLED.
  lumicut_status wait(uint32_t milliseconds = LUMICUT_FOREVER) const {
    auto s = make<lumicut_status>();
    check(functions(), functions().render_wait(get(), milliseconds, &s));
    return s;
  }
  // False: none now.
  bool next_tile(lumicut_tile& tile) const {
    tile.struct_size = sizeof(tile);
    check(functions(), functions().render_next_tile(get(), &tile));
    return tile.x1 != 0;
  }
  // Rows packed from the top; of the crop, or of a part of it.
  std::vector<float> read(const char* channel) const { return read(channel, crop()); }
  std::vector<float> read(const char* channel, const lumicut_tile& part) const {
    const uint64_t width = part.x1 > part.x0 ? part.x1 - part.x0 : 0,
                   height = part.y1 > part.y0 ? part.y1 - part.y0 : 0;
    std::vector<float> out(width * height * components(channel));
    check(functions(), functions().render_read(get(), channel, &part, out.data()));
    return out;
  }
  // Light groups that have a channel "radiance.GROUP", rising.
  std::vector<uint32_t> groups() const {
    const uint32_t* view = nullptr;
    uint64_t count = 0;
    check(functions(), functions().render_groups(get(), &view, &count));
    return {view, view + count};
  }
  // For lumicut_render_desc.checkpoint; empty: none yet. Lasts until the next call that is not [any].
  Span<const unsigned char> checkpoint() const {
    const void* data = nullptr;
    uint64_t size = 0;
    check(functions(), functions().render_checkpoint(get(), &data, &size));
    return {static_cast<const unsigned char*>(data), static_cast<size_t>(size)};
  }

 private:
  lumicut_tile crop() const {
    auto whole = make<lumicut_tile>();
    const bool all = desc_.crop[2] == 0;
    whole.x0 = desc_.crop[0], whole.y0 = desc_.crop[1];
    whole.x1 = all ? desc_.width : desc_.crop[2], whole.y1 = all ? desc_.height : desc_.crop[3];
    return whole;
  }
  // 3 for radiance.GROUP, and for a name that does not exist: the read that follows says so.
  uint64_t components(const std::string& channel) const {
    for (const lumicut_channel_info& info : channels(functions()))
      if (channel == info.name) return info.components;
    return 3;
  }
  lumicut_render_desc desc_;
};

}  // namespace lumicut::api

#endif  // LUMICUT_HPP
