// The Lumicut library, loaded while the program runs: a table of its functions. Nothing here links it.
#pragma once

#include <stdexcept>
#include <string>
#include <utility>

#include "lumicut/lumicut.h"

namespace lumicut::io {

// Every function of lumicut.h, under its name without "lumicut_".
// clang-format off
#define LUMICUT_FOR_ALL_FUNCTIONS(X)                                                                                         \
  X(version) X(last_error) X(get_extension) X(device_create) X(retain) X(release) X(get_status) X(cancel) X(stats_json)      \
  X(accel_build) X(accel_get_info) X(accel_get_node) X(accel_get_primitives) X(accel_intersect) X(accel_occluded)            \
  X(scene_create) X(scene_set_textures) X(scene_set_materials) X(scene_add_mesh) X(scene_update_mesh) X(scene_set_profiles)  \
  X(scene_set_lights) X(scene_set_environment) X(scene_set_camera) X(scene_set_trace) X(scene_commit)                        \
  X(get_integrator_info) X(get_param_info) X(integrator_create) X(integrator_set) X(integrator_get) X(integrator_set_lights) \
  X(integrator_prepare) X(integrator_get_lights) X(integrator_shade) X(get_channel_info)                                     \
  X(render_start) X(render_wait) X(render_next_tile) X(render_read) X(render_groups) X(render_checkpoint)
// clang-format on

struct Api {
#define LUMICUT_MEMBER(name) decltype(&lumicut_##name) name = nullptr;
  LUMICUT_FOR_ALL_FUNCTIONS(LUMICUT_MEMBER)
#undef LUMICUT_MEMBER
};

// What a call of the library refused, with the library's own text.
class LibraryError : public std::runtime_error {
 public:
  LibraryError(lumicut_result code, const std::string& text) : std::runtime_error(text), code_(code) {}
  lumicut_result code() const { return code_; }

 private:
  lumicut_result code_;
};

class Library {
 public:
  // Opens, in this order: the environment's LUMICUT_LIBRARY; ../lib/liblumicut.so beside this program's folder; the
  // system's liblumicut.so.1. Throws LibraryError when none can be loaded, lacks a function or speaks another major
  // version of the ABI.
  Library();
  ~Library();
  Library(const Library&) = delete;
  Library& operator=(const Library&) = delete;

  const Api& api() const { return api_; }
  const std::string& path() const { return path_; }

 private:
  void* handle_ = nullptr;
  std::string path_;
  Api api_;
};

// Throws LibraryError(code, "<doing>: <the library's text>") unless `code` is LUMICUT_OK.
void check(const Api& api, lumicut_result code, const std::string& doing);

// A counted handle, released at the end of its scope.
template <typename T>
class Handle {
 public:
  explicit Handle(const Api& api) : api_(&api) {}
  ~Handle() { reset(); }
  Handle(Handle&& other) noexcept : api_(other.api_), handle_(std::exchange(other.handle_, nullptr)) {}
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  void reset() {
    if (handle_) api_->release(std::exchange(handle_, nullptr));
  }
  T get() const { return handle_; }
  T* out() { return &handle_; }

 private:
  const Api* api_;
  T handle_ = nullptr;
};

}  // namespace lumicut::io
