// The C ABI: bytes become a sequence of calls, with descriptors of any size and values, handles of the wrong kind and
// NULLs. Pointers are good for as many elements as their counts say; a count beyond what there is stays only where it is
// beyond any memory, so that the library must refuse it unread.
#include <fuzzer/FuzzedDataProvider.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstring>
#include <deque>
#include <functional>
#include <limits>
#include <memory>
#include <mutex>
#include <span>
#include <thread>

#include "lumicut/lumicut_lights.h"
#include "lumicut/lumicut_state.h"
#include "tests/fuzz/fuzz.h"
#include "tests/plugin/box_scene.h"

namespace {

using box::api::make;

const std::vector<const char*>& integrator_ids() {
  static const auto all = [] {
    std::vector<const char*> ids;
    for (const auto& integrator : box::api::integrators()) ids.push_back(integrator.id);
    return ids;
  }();
  return all;
}

// Of any integrator.
const std::vector<const char*>& parameter_names() {
  static const auto all = [] {
    std::vector<const char*> names;
    for (const char* integrator : integrator_ids())
      for (const auto& parameter : box::api::params(integrator))
        if (std::ranges::none_of(names, [&](const char* name) { return std::strcmp(name, parameter.id) == 0; }))
          names.push_back(parameter.id);
    return names;
  }();
  return all;
}

constexpr float kSpecial[] = {0.0f,
                              -0.0f,
                              1.0f,
                              -1.0f,
                              0.5f,
                              2.0f,
                              1e-6f,
                              1e6f,
                              1e-30f,
                              1e-45f,
                              1e18f,
                              -2e18f,
                              1e30f,
                              3.4e38f,
                              -3.4e38f,
                              std::numeric_limits<float>::infinity(),
                              -std::numeric_limits<float>::infinity(),
                              std::numeric_limits<float>::quiet_NaN(),
                              3.14159265f};

constexpr std::initializer_list<const char*> kBuilders = {
    "agglomerative", "agglomerative-parallel", "binned-agglomerative", "binned", "binned-longest",
    "sweep",         "binned+reinsert",        "sweep+reinsert:5x3"};

// Cancels what a blocking call works on when it takes long. What does not hear of it meets libFuzzer's time limit.
class Watchdog {
 public:
  Watchdog() : thread_([this] { watch(); }) { thread_.detach(); }
  template <typename Fn>
  lumicut_result guard(void* handle, Fn&& call) {
    {
      const std::lock_guard lock(mutex_);
      handle_ = handle, deadline_ = Clock::now() + std::chrono::milliseconds(150);
    }
    changed_.notify_one();
    const lumicut_result result = call();
    const std::lock_guard lock(mutex_);
    handle_ = nullptr;
    return result;
  }

 private:
  using Clock = std::chrono::steady_clock;
  void watch() {
    std::unique_lock lock(mutex_);
    for (;;) {
      if (handle_ == nullptr) {
        changed_.wait(lock);
      } else if (changed_.wait_until(lock, deadline_) == std::cv_status::timeout && handle_ != nullptr &&
                 Clock::now() >= deadline_) {
        lumicut_cancel(handle_);
        deadline_ = Clock::now() + std::chrono::milliseconds(20);
      }
    }
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  void* handle_ = nullptr;
  Clock::time_point deadline_{};
  std::thread thread_;
};

// Hits nothing, or everything at once.
void trace_nothing(void*, lumicut_rayhit*, uint64_t) {}
void occlude_all(void*, lumicut_ray* rays, uint64_t count) {
  for (uint64_t i = 0; i < count; ++i) rays[i].tfar = -std::numeric_limits<float>::infinity();
}

class Session {
 public:
  Session(const uint8_t* data, size_t size) : in_(data, size) {}
  ~Session() {
    for (const auto& o : objects_) lumicut_release(o.handle);
  }
  void run() {
    for (int step = 0; step < 60 && in_.remaining_bytes() > 0; ++step) {
      blocks_.clear();
      const std::function<lumicut_result()>& call = calls_[in_.ConsumeIntegralInRange<size_t>(0, calls_.size() - 1)];
      const lumicut_result result = call();
      if (result < LUMICUT_OK || result >= LUMICUT_INTERNAL) lumicut::fuzz::finding(lumicut_last_error());
      if (result != LUMICUT_OK && lumicut_last_error()[0] == '\0') lumicut::fuzz::finding("an error without a text");
    }
  }

 private:
  enum Kind { kDevice, kScene, kIntegrator, kRender, kAccel };
  struct Object {
    Kind kind;
    void* handle;
    uint32_t width = 0, height = 0;  // of renders
  };

  // ---- Bytes into arguments ----

  bool rarely(int of = 16) { return in_.ConsumeIntegralInRange<int>(1, of) == of; }

  float number() {
    return in_.ConsumeBool() ? kSpecial[in_.ConsumeIntegralInRange<size_t>(0, std::size(kSpecial) - 1)]
                             : in_.ConsumeFloatingPointInRange<float>(-2.0f, 2.0f);
  }

  // One that lives until the next step.
  void* block(size_t bytes) { return blocks_.emplace_back(new uint8_t[bytes]()).get(); }

  // Changes up to three words from byte `from` on.
  void change(void* data, size_t bytes, size_t from = 0) {
    if (bytes < from + 4) return;
    for (int n = in_.ConsumeIntegralInRange<int>(0, 3); n > 0; --n) {
      const size_t at = from + 4 * in_.ConsumeIntegralInRange<size_t>(0, (bytes - from) / 4 - 1);
      uint32_t word = 0;
      if (in_.ConsumeBool()) {
        const float f = number();
        std::memcpy(&word, &f, 4);
      } else {
        word = in_.ConsumeBool() ? in_.ConsumeIntegral<uint32_t>() : in_.ConsumeIntegralInRange<uint32_t>(0, 8);
      }
      std::memcpy(static_cast<uint8_t*>(data) + at, &word, 4);
    }
  }

  template <typename T>
  std::vector<T> changed(std::vector<T> values) {
    change(values.data(), values.size() * sizeof(T));
    return values;
  }
  // In a block of their own, so that AddressSanitizer sees what is read beyond.
  template <typename T>
  T* keep(const std::vector<T>& values) {
    T* out = static_cast<T*>(block(values.size() * sizeof(T)));
    if (!values.empty()) std::memcpy(static_cast<void*>(out), values.data(), values.size() * sizeof(T));
    return out;
  }

  uint32_t struct_size(size_t usual) {
    if (!rarely()) return static_cast<uint32_t>(usual);
    return in_.ConsumeBool() ? in_.ConsumeIntegralInRange<uint32_t>(0, 4100) : in_.ConsumeIntegral<uint32_t>();
  }

  // `count` descriptors side by side, each changed a little, then `mend`ed: pointers and counts are put right there.
  template <typename T, typename Mend>
  T* descriptors(const T& usual, size_t count, const Mend& mend) {
    if (rarely(40)) return nullptr;
    const uint32_t size = struct_size(sizeof(T));
    const size_t stride = size < 4 ? 4 : size > 4096 ? 4096 : size;  // what is larger is refused by its size alone
    auto* out = static_cast<uint8_t*>(block(stride * count));
    for (size_t i = 0; i < count; ++i) {
      T t = usual;
      change(&t, sizeof(T), 4);
      mend(t);
      t.struct_size = rarely(60) ? in_.ConsumeIntegral<uint32_t>() : size;
      if (i == 0) t.struct_size = size;
      std::memcpy(out + i * stride, &t, std::min(stride, sizeof(T)));
      if (stride > sizeof(T) && rarely()) out[i * stride + sizeof(T)] = 1;
    }
    return reinterpret_cast<T*>(out);
  }
  template <typename T>
  T* output() {
    return descriptors(make<T>(), 1, [](T&) {});
  }
  static void cap(uint64_t& count, uint64_t there) {
    if (count > there && count < uint64_t{1} << 40) count = there;
  }

  // ---- Objects ----

  Object* pick(Kind kind) {
    Object* found = nullptr;
    size_t skip = in_.ConsumeIntegralInRange<size_t>(0, 3);
    for (Object& o : objects_)
      if (o.kind == kind) {
        found = &o;
        if (skip-- == 0) break;
      }
    return found;
  }
  // Mostly of the kind asked for; else NULL or another kind.
  template <typename T>
  T handle(Kind kind) {
    if (rarely(30)) return nullptr;
    if (rarely(30)) kind = static_cast<Kind>(in_.ConsumeIntegralInRange<int>(0, kAccel));
    if (kind == kDevice) return reinterpret_cast<T>(device());
    const Object* const o = pick(kind);
    return o == nullptr ? nullptr : static_cast<T>(o->handle);
  }
  static lumicut_device device() {
    static const box::api::Device one(1);
    return one.get();
  }
  static Watchdog& watchdog() {
    static Watchdog& one = *new Watchdog;
    return one;
  }
  lumicut_result add(Kind kind, lumicut_result result, void* made) {
    if (result == LUMICUT_OK && made != nullptr) {
      objects_.push_back({kind, made});
      if (objects_.size() > 12) {
        lumicut_release(objects_.front().handle);
        objects_.pop_front();
      }
    }
    return result;
  }

  const char* word(std::span<const char* const> known) {
    if (rarely(30)) return nullptr;
    if (rarely(8)) {
      const std::string text = in_.ConsumeRandomLengthString(12);
      char* out = static_cast<char*>(block(text.size() + 1));
      std::memcpy(out, text.c_str(), text.size() + 1);
      return out;
    }
    return known[in_.ConsumeIntegralInRange<size_t>(0, known.size() - 1)];
  }
  const char* word(std::initializer_list<const char*> known) { return word(std::span(known.begin(), known.size())); }

  // ---- Calls ----

  lumicut_result create_device() {
    lumicut_device made = nullptr;
    auto desc = make<lumicut_device_desc>();
    desc.abi_major = LUMICUT_ABI_MAJOR;
    const lumicut_result result = lumicut_device_create(descriptors(desc, 1,
                                                                    [](lumicut_device_desc& d) {
                                                                      d.log = nullptr;
                                                                      if (d.threads > 4) d.threads = 4;
                                                                    }),
                                                        rarely() ? nullptr : &made);
    lumicut_release(made);
    return result;
  }

  lumicut_result create_scene() {
    const char* accel = word({"bvh", "embree", "agglomerative"});
    const char* builder = rarely(3) ? word(kBuilders) : nullptr;
    const auto* desc = descriptors(make<lumicut_scene_desc>(), 1,
                                   [&](lumicut_scene_desc& d) { d.accel = accel, d.builder = builder; });
    lumicut_scene made = nullptr;
    const lumicut_result result = lumicut_scene_create(handle<lumicut_device>(kDevice), desc, &made);
    return add(kScene, result, made);
  }

  // What most calls need to get anywhere.
  lumicut_result create_good_scene() {
    lumicut_scene made = nullptr;
    lumicut_scene_create(device(), nullptr, &made);
    const auto mesh = box::geometry();
    const auto materials = box::materials();
    const auto m = mesh.mesh();
    const auto lamp = box::lamp();
    const auto camera = box::camera();
    lumicut_scene_set_materials(made, materials.data(), materials.size());
    lumicut_scene_add_mesh(made, &m, nullptr);
    lumicut_scene_set_lights(made, &lamp, 1);
    lumicut_scene_set_camera(made, &camera);
    return add(kScene, lumicut_scene_commit(made), made);
  }

  lumicut_result set_textures() {
    const size_t count = in_.ConsumeIntegralInRange<size_t>(0, 2);
    auto usual = make<lumicut_texture>();
    usual.width = 4, usual.height = 3, usual.channels = 3;
    const auto* textures = descriptors(usual, count, [&](lumicut_texture& t) {
      if (rarely(3)) return t = make<lumicut_texture>(), t.program = program(), void();
      t.program = nullptr;
      // What is more is refused.
      const auto limit = [](uint32_t& v, uint32_t most) { v = v > most && v <= 65536 ? most : v; };
      limit(t.width, 9), limit(t.height, 9);
      const size_t values = t.width <= 9 && t.height <= 9 && t.channels <= 4 ? t.width * t.height * t.channels : 0;
      std::vector<float> pixels(values, 0.5f);
      t.pixels = rarely() ? nullptr : keep(changed(pixels));
    });
    return lumicut_scene_set_textures(handle<lumicut_scene>(kScene), textures, textures == nullptr ? 1 : count);
  }

  // Mostly in order, each step of earlier ones and of constants.
  const lumicut_program* program() {
    const size_t count = in_.ConsumeIntegralInRange<size_t>(0, 6);
    std::vector<lumicut_instruction> steps;
    for (size_t i = 0; i < count; ++i) {
      lumicut_instruction step{};
      step.op = in_.ConsumeIntegralInRange<uint32_t>(0, LUMICUT_OP_IMAGE);
      step.mode = in_.ConsumeIntegralInRange<uint32_t>(0, 7);
      const size_t taken = std::min<size_t>(program_inputs(step.op), 8);
      for (size_t k = 0; k < taken; ++k)
        step.inputs[k] = in_.ConsumeIntegralInRange<int32_t>(-4, static_cast<int>(i) - 1);
      if (step.op == LUMICUT_OP_RAMP) step.count = 6;
      if (step.op == LUMICUT_OP_CURVES) step.count = 8;
      if (step.op == LUMICUT_OP_BRICK) step.count = 4;
      if (step.op == LUMICUT_OP_IMAGE) step.data = 1;
      steps.push_back(step);
    }
    auto usual = make<lumicut_program>();
    std::vector<float> constants(12, 0.5f), table(8, 0.5f);
    usual.instruction_count = static_cast<uint32_t>(count), usual.constant_count = 4, usual.table_count = 8;
    const auto* kept_steps = rarely() ? nullptr : keep(changed(steps));
    const auto* kept_constants = keep(changed(constants));
    const auto* kept_table = keep(changed(table));
    return descriptors(usual, 1, [&](lumicut_program& p) {
      const auto limit = [](uint32_t& v, uint32_t most) { v = std::min(v, most); };
      limit(p.instruction_count, static_cast<uint32_t>(count)), limit(p.constant_count, 4), limit(p.table_count, 8);
      p.instructions = kept_steps, p.constants = kept_constants, p.table = kept_table;
    });
  }
  static uint32_t program_inputs(uint32_t op) {
    constexpr uint32_t kInputs[] = {0, 0, 0, 0, 0, 0, 0, 1, 3, 3, 1, 1, 3, 3, 6, 4, 4, 3,
                                    4, 1, 2, 2, 4, 2, 8, 7, 5, 6, 2, 6, 1, 1, 2, 1, 3};
    return kInputs[op];
  }

  lumicut_result set_materials() {
    const size_t count = in_.ConsumeIntegralInRange<size_t>(0, 5);
    const auto usual = box::materials();
    const auto* materials = descriptors(usual[3], count, [](lumicut_material&) {});
    return lumicut_scene_set_materials(handle<lumicut_scene>(kScene), materials, count);
  }

  lumicut_result add_mesh() {
    box::Geometry g;
    if (in_.ConsumeBool())
      g = box::geometry();
    else
      g.quad({{{-1, -1, -1}, {1, -1, -1}, {1, 1, -1}, {-1, 1, -1}}}, 0);
    const uint64_t instances = in_.ConsumeIntegralInRange<uint64_t>(0, 3);
    std::vector<float> transforms;
    for (uint64_t i = 0; i < instances; ++i)
      transforms.insert(transforms.end(), {1, 0, 0, static_cast<float>(i), 0, 1, 0, 0, 0, 0, 1, 0});
    const auto* positions = keep(changed(g.positions));
    const auto* normals = rarely(3) ? keep(changed(g.positions)) : nullptr;
    const auto* uvs = rarely(3) ? keep(changed(std::vector<float>(g.positions.size() / 3 * 2, 0.25f))) : nullptr;
    const auto* indices = keep(changed(g.indices));
    const auto* materials = in_.ConsumeBool() ? keep(changed(g.materials)) : nullptr;
    const auto* placed = instances > 0 || rarely() ? keep(changed(transforms)) : nullptr;
    auto usual = g.mesh();
    usual.transform_count = instances;
    const auto* mesh = descriptors(usual, 1, [&](lumicut_mesh& m) {
      cap(m.vertex_count, g.positions.size() / 3), cap(m.triangle_count, g.indices.size() / 3);
      cap(m.transform_count, instances);
      m.positions = positions, m.normals = normals, m.uvs = uvs, m.indices = indices, m.materials = materials;
      m.transforms = placed;
      m.attributes = nullptr, m.attribute_count = rarely() ? in_.ConsumeIntegral<uint64_t>() : 0;
      if (rarely(4)) {
        auto attribute = make<lumicut_attribute>();
        attribute.components = 1, attribute.domain = in_.ConsumeIntegralInRange<uint32_t>(0, 2);
        // As many as the largest mesh has places, of as many components as there may be.
        const auto* values =
            keep(changed(std::vector<float>(12 * std::max(g.positions.size(), g.indices.size()), 0.5f)));
        m.attribute_count = in_.ConsumeIntegralInRange<uint64_t>(1, 2);
        m.attributes = descriptors(attribute, 2, [&](lumicut_attribute& a) { a.values = rarely() ? nullptr : values; });
      }
      if (rarely()) m.positions = nullptr;
      if (rarely()) m.indices = nullptr;
    });
    uint32_t id = 0;
    return lumicut_scene_add_mesh(handle<lumicut_scene>(kScene), mesh, rarely() ? nullptr : &id);
  }

  lumicut_result update_mesh() {
    // Room for the largest mesh that add_mesh makes.
    const auto g = box::geometry();
    const auto floats = [&](size_t n) { return rarely(3) ? nullptr : keep(changed(std::vector<float>(n, 0.5f))); };
    const float* positions = rarely(3) ? nullptr : keep(changed(g.positions));
    const float* normals = floats(g.positions.size());
    const float* transforms = floats(12 * 3);
    return lumicut_scene_update_mesh(handle<lumicut_scene>(kScene), in_.ConsumeIntegralInRange<uint32_t>(0, 3),
                                     positions, normals, transforms);
  }

  lumicut_result set_lights() {
    const size_t count = in_.ConsumeIntegralInRange<size_t>(0, 3);
    auto usual = box::lamp();
    usual.type = in_.ConsumeIntegralInRange<uint32_t>(0, 4);
    usual.direction[1] = -1, usual.angle = 1, usual.profile = rarely(4) ? 1 : 0;
    if (usual.profile != 0) usual.type = LUMICUT_POINT;
    const auto* lights = descriptors(usual, count, [](lumicut_light&) {});
    return lumicut_scene_set_lights(handle<lumicut_scene>(kScene), lights, count);
  }

  lumicut_result set_profiles() {
    constexpr uint32_t kVertical = 3, kHorizontal = 5;
    auto usual = make<lumicut_profile>();
    usual.vertical_count = kVertical, usual.horizontal_count = in_.ConsumeBool() ? 1 : kHorizontal;
    const auto* vertical = keep(changed(std::vector<float>{0, 1, 2}));
    const auto* horizontal = keep(changed(std::vector<float>{0, 1, 2, 3, 6.2831853f}));
    const auto* values = keep(changed(std::vector<float>(kVertical * kHorizontal, 1.0f)));
    const auto* profiles = descriptors(usual, 1, [&](lumicut_profile& p) {
      const auto limit = [](uint32_t& v, uint32_t most) { v = v > most && v <= 65536 ? most : v; };
      limit(p.vertical_count, kVertical), limit(p.horizontal_count, kHorizontal);
      p.vertical = vertical, p.horizontal = horizontal, p.values = rarely() ? nullptr : values;
      // One that is refused by one count must not be read by the other.
      if (p.vertical_count > kVertical || p.horizontal_count > kHorizontal) p.vertical_count = 0;
    });
    return lumicut_scene_set_profiles(handle<lumicut_scene>(kScene), profiles, in_.ConsumeIntegralInRange(0, 1));
  }

  lumicut_result set_environment() {
    auto usual = make<lumicut_environment>();
    usual.color[0] = usual.color[1] = usual.color[2] = 1;
    usual.texture = in_.ConsumeIntegralInRange<int32_t>(0, 1);
    return lumicut_scene_set_environment(handle<lumicut_scene>(kScene),
                                         descriptors(usual, 1, [](lumicut_environment&) {}));
  }

  lumicut_result set_camera() {
    return lumicut_scene_set_camera(handle<lumicut_scene>(kScene),
                                    descriptors(box::camera(), 1, [](lumicut_camera&) {}));
  }

  lumicut_result set_trace() {
    const auto* trace = descriptors(make<lumicut_trace>(), 1, [&](lumicut_trace& t) {
      t.intersect = rarely() ? nullptr : trace_nothing;
      t.occluded = rarely() ? nullptr : occlude_all;
    });
    return lumicut_scene_set_trace(handle<lumicut_scene>(kScene), trace);
  }

  lumicut_result commit() {
    const auto scene = handle<lumicut_scene>(kScene);
    return watchdog().guard(scene, [&] { return lumicut_scene_commit(scene); });
  }

  lumicut_result create_integrator() {
    lumicut_integrator made = nullptr;
    const lumicut_result result =
        lumicut_integrator_create(handle<lumicut_device>(kDevice), word(integrator_ids()), &made);
    if (made != nullptr) {
      lumicut_integrator_set(made, "vpls", "24");
      lumicut_integrator_set(made, "samples", "1");
    }
    return add(kIntegrator, result, made);
  }

  lumicut_result set_parameter() {
    const auto integrator = handle<lumicut_integrator>(kIntegrator);
    lumicut_param_info info = make<lumicut_param_info>();
    const char* name = word(parameter_names());
    const char* value =
        word({"0",          "1",      "2",    "16",         "64",       "0.001",   "0.5",           "1e-30",
              "-1",         "nan",    "inf",  "true",       "false",    "full",    "sampling",      "spheres",
              "points",     "random", "mean", "stochastic", "unbiased", "cubemap", "agglomerative", "divisive_3d",
              "divisive_6d"});
    // Numbers of lights, rows and columns that are allowed and only take long.
    if (value != nullptr && std::strtod(value, nullptr) > 1000.0) value = "1000";
    lumicut_get_param_info(word(integrator_ids()), in_.ConsumeIntegral<uint32_t>(), &info);
    if (rarely()) lumicut_integrator_get(integrator, name);
    return lumicut_integrator_set(integrator, name, value);
  }

  lumicut_result set_host_lights() {
    lumicut_vpl light{};
    light.kind = in_.ConsumeIntegralInRange<uint32_t>(0, 4);
    light.position[1] = 0.5f, light.position[2] = -1, light.normal[1] = -1;
    light.intensity[0] = light.intensity[1] = light.intensity[2] = 1;
    light.cos_outer = 0.5f;
    const auto* lights = keep(changed(std::vector<lumicut_vpl>(in_.ConsumeIntegralInRange<size_t>(1, 4), light)));
    const auto integrator = handle<lumicut_integrator>(kIntegrator);
    if (in_.ConsumeBool())
      return lumicut_integrator_set_lights(integrator, rarely() ? nullptr : lights,
                                           in_.ConsumeIntegralInRange<uint64_t>(0, 1));
    lumicut_vpl_origin origin{};
    origin.source = in_.ConsumeIntegralInRange<uint32_t>(0, 2);
    origin.offset = 0.001f, origin.area = origin.source == LUMICUT_SOURCE_AREA ? 0.1f : 0.0f;
    if (in_.ConsumeBool()) {
      origin.slope = 0.5f, origin.again = 0.1f, origin.retro = 1, origin.dim = 0.5f;
      origin.mirror[1] = -1, origin.lobe_mean = 1;
    }
    const auto* origins = keep(changed(std::vector<lumicut_vpl_origin>(4, origin)));
    auto usual = make<lumicut_vpl_set>();
    usual.count = 1, usual.emitter_samples = 1;
    return lumicut::api::lights_extension().set(integrator, descriptors(usual, 1, [&](lumicut_vpl_set& set) {
                                                  cap(set.count, 1);
                                                  set.lights = rarely() ? nullptr : lights;
                                                  set.origins = rarely() ? nullptr : origins;
                                                }));
  }

  lumicut_result prepare() {
    const auto integrator = handle<lumicut_integrator>(kIntegrator);
    const auto scene = handle<lumicut_scene>(kScene);
    return watchdog().guard(integrator, [&] { return lumicut_integrator_prepare(integrator, scene); });
  }

  lumicut_result get_lights() {
    const lumicut_vpl* lights = nullptr;
    uint64_t count = 0;
    const lumicut_result result =
        lumicut_integrator_get_lights(handle<lumicut_integrator>(kIntegrator), rarely() ? nullptr : &lights, &count);
    float sum = 0;
    for (uint64_t i = 0; i < count; ++i) sum += lights[i].intensity[0];
    auto set = make<lumicut_vpl_set>();
    if (lumicut::api::lights_extension().get(handle<lumicut_integrator>(kIntegrator), &set) == LUMICUT_OK)
      for (uint64_t i = 0; i < set.count; ++i) sum += set.origins[i].offset;
    sum_ = sum_ + sum;
    return result;
  }

  lumicut_result shade() {
    lumicut_point point{};
    point.position[1] = -1, point.position[2] = -1;
    point.normal[1] = point.geometric_normal[1] = point.to_viewer[1] = 1;
    const auto points = changed(std::vector<lumicut_point>(in_.ConsumeIntegralInRange<size_t>(1, 5), point));
    const auto* kept = keep(points);
    float* radiance = keep(std::vector<float>(3 * points.size()));
    const auto integrator = handle<lumicut_integrator>(kIntegrator);
    return watchdog().guard(integrator, [&] {
      return lumicut_integrator_shade(integrator, kept, rarely() ? 0 : points.size(), rarely() ? nullptr : radiance);
    });
  }

  lumicut_result start_render() {
    const std::string checkpoint = rarely(8) ? in_.ConsumeRandomLengthString(100) : "";
    auto usual = box::frame(8, 6);
    usual.passes = in_.ConsumeIntegralInRange<uint32_t>(0, 2);
    usual.flags = in_.ConsumeIntegralInRange<uint32_t>(0, 31);
    uint32_t width = 0, height = 0;
    const auto* bytes = keep(std::vector<char>(checkpoint.begin(), checkpoint.end()));
    const auto* desc = descriptors(usual, 1, [&](lumicut_render_desc& d) {
      // Films that fit into memory only take long; those beyond any must be refused.
      const auto limit = [](uint32_t& v, uint32_t most) { v = v > most && v < 60000 ? most : v; };
      limit(d.width, 16), limit(d.height, 16);
      if ((d.width > 16) != (d.height > 16)) d.width = d.height = 16;
      d.checkpoint = checkpoint.empty() ? nullptr : bytes;
      cap(d.checkpoint_size, checkpoint.size());
      if (d.checkpoint == nullptr) d.checkpoint_size = 0;
      width = d.width, height = d.height;
    });
    lumicut_render made = nullptr;
    const lumicut_result result = lumicut_render_start(handle<lumicut_integrator>(kIntegrator),
                                                       handle<lumicut_scene>(kScene), desc, rarely() ? nullptr : &made);
    add(kRender, result, made);
    if (made != nullptr) objects_.back().width = width, objects_.back().height = height;
    return result;
  }

  lumicut_result wait() {
    const uint32_t most = in_.ConsumeIntegralInRange<uint32_t>(0, 60);
    return lumicut_render_wait(handle<lumicut_render>(kRender), most, rarely(4) ? output<lumicut_status>() : nullptr);
  }

  lumicut_result next_tile() {
    return lumicut_render_next_tile(handle<lumicut_render>(kRender), output<lumicut_tile>());
  }

  lumicut_result read() {
    const Object* const o = pick(kRender);
    if (o == nullptr || o->width > 16) return LUMICUT_OK;
    float* out = keep(std::vector<float>(size_t{3} * o->width * o->height));
    auto rect = make<lumicut_tile>();
    rect.x1 = o->width, rect.y1 = o->height;
    const auto* part = in_.ConsumeBool() ? nullptr : descriptors(rect, 1, [](lumicut_tile&) {});
    return lumicut_render_read(static_cast<lumicut_render>(o->handle),
                               word({"radiance", "alpha", "depth", "normal", "albedo", "error", "radiance.0",
                                     "radiance.1", "illuminance", "position", "cut_size", "rays"}),
                               part, rarely() ? nullptr : out);
  }

  lumicut_result groups_and_checkpoint() {
    const auto render = handle<lumicut_render>(kRender);
    const uint32_t* groups = nullptr;
    const void* bytes = nullptr;
    uint64_t count = 0, size = 0;
    lumicut_render_groups(render, &groups, &count);
    const lumicut_result result = lumicut_render_checkpoint(render, rarely() ? nullptr : &bytes, &size);
    if (size > 0) sum_ = sum_ + static_cast<const uint8_t*>(bytes)[size - 1];
    return result;
  }

  lumicut_result ask() {
    void* const any = handle<void*>(static_cast<Kind>(in_.ConsumeIntegralInRange<int>(0, kAccel)));
    switch (in_.ConsumeIntegralInRange<int>(0, 6)) {
      case 0:
        return lumicut_get_status(any, output<lumicut_status>());
      case 1:
        return lumicut_cancel(any);
      case 2:
        lumicut_stats_json(any);
        return LUMICUT_OK;
      case 3:
        return lumicut_get_integrator_info(in_.ConsumeIntegralInRange<uint32_t>(0, 12),
                                           output<lumicut_integrator_info>());
      case 4:
        return lumicut_get_param_info(word(integrator_ids()), in_.ConsumeIntegralInRange<uint32_t>(0, 30),
                                      output<lumicut_param_info>());
      case 5:
        return lumicut_get_channel_info(in_.ConsumeIntegralInRange<uint32_t>(0, 20), output<lumicut_channel_info>());
      default:
        lumicut_retain(any);
        lumicut_release(any);
        return LUMICUT_OK;
    }
  }

  lumicut_result release_one() {
    if (objects_.empty()) return LUMICUT_OK;
    const auto at = objects_.begin() + in_.ConsumeIntegralInRange<std::ptrdiff_t>(0, std::ssize(objects_) - 1);
    lumicut_release(at->handle);
    objects_.erase(at);
    return LUMICUT_OK;
  }

  lumicut_result state() {
    const auto& extension =
        *static_cast<const lumicut_state_extension*>(lumicut_get_extension(LUMICUT_STATE_EXTENSION));
    const auto integrator = handle<lumicut_integrator>(kIntegrator);
    const auto scene = handle<lumicut_scene>(kScene);
    uint64_t size = 0;
    const lumicut_result result = extension.save(integrator, nullptr, &size);
    if (result != LUMICUT_OK) return result;
    std::vector<uint8_t> bytes(size);
    uint64_t room = rarely() ? in_.ConsumeIntegralInRange<uint64_t>(0, size) : size;
    extension.save(integrator, bytes.data(), &room);
    return watchdog().guard(
        integrator, [&] { return extension.load(integrator, scene, bytes.data(), rarely() ? size / 2 : size); });
  }

  lumicut_result build_accel() {
    const auto g = box::geometry();
    const bool boxes = rarely(4);
    const auto* positions = keep(changed(g.positions));
    const auto* indices = keep(changed(g.indices));
    const auto* corners = keep(changed(std::vector<float>{0, 0, 0, 1, 1, 1, 2, 0, 0, 3, 1, 1}));
    const char* kind = word({"bvh", "embree", "agglomerative"});
    const char* builder = rarely(3) ? word(kBuilders) : nullptr;
    auto usual = make<lumicut_accel_desc>();
    usual.position_count = g.positions.size() / 3;
    usual.triangle_count = boxes ? 0 : g.indices.size() / 3;
    usual.box_count = boxes ? 2 : 0;
    const auto* desc = descriptors(usual, 1, [&](lumicut_accel_desc& d) {
      d.position_stride = d.position_stride > 4096 ? d.position_stride
                          : d.position_stride < 12 ? d.position_stride
                                                   : 12;
      cap(d.position_count, g.positions.size() / 3), cap(d.triangle_count, g.indices.size() / 3), cap(d.box_count, 2);
      d.kind = kind, d.builder = builder, d.positions = positions, d.indices = indices, d.boxes = corners;
      if (rarely()) d.positions = nullptr;
    });
    lumicut_accel made = nullptr;
    const lumicut_result result =
        lumicut_accel_build(handle<lumicut_device>(kDevice), desc, rarely() ? nullptr : &made);
    return add(kAccel, result, made);
  }

  lumicut_result trace() {
    const auto accel = handle<lumicut_accel>(kAccel);
    lumicut_rayhit ray{};
    ray.ray.org_z = 2, ray.ray.dir_z = -1, ray.ray.tfar = in_.ConsumeBool() ? 100.0f : INFINITY, ray.ray.mask = ~0u;
    ray.hit.geom_id = LUMICUT_NO_ID;
    const size_t count = in_.ConsumeIntegralInRange<size_t>(0, 20);
    if (in_.ConsumeBool())
      return lumicut_accel_intersect(accel, keep(changed(std::vector<lumicut_rayhit>(count, ray))), count);
    return lumicut_accel_occluded(accel, keep(changed(std::vector<lumicut_ray>(count, ray.ray))), count);
  }

  lumicut_result ask_accel() {
    const auto accel = handle<lumicut_accel>(kAccel);
    const uint32_t* ids = nullptr;
    uint64_t count = 0;
    lumicut_accel_get_node(accel, in_.ConsumeIntegralInRange<uint32_t>(0, 100), output<lumicut_accel_node_info>());
    lumicut_accel_get_primitives(accel, &ids, &count);
    if (count > 0) sum_ = sum_ + static_cast<float>(ids[count - 1]);
    return lumicut_accel_get_info(accel, output<lumicut_accel_info>());
  }

  FuzzedDataProvider in_;
  std::vector<std::unique_ptr<uint8_t[]>> blocks_;
  std::deque<Object> objects_;
  volatile float sum_ = 0;  // so that what is read is read
  const std::vector<std::function<lumicut_result()>> calls_ = {
      [this] { return create_good_scene(); },
      [this] { return create_integrator(); },
      [this] { return start_render(); },
      [this] { return wait(); },
      [this] { return read(); },
      [this] { return prepare(); },
      [this] { return shade(); },
      [this] { return create_scene(); },
      [this] { return set_textures(); },
      [this] { return set_materials(); },
      [this] { return add_mesh(); },
      [this] { return update_mesh(); },
      [this] { return set_lights(); },
      [this] { return set_profiles(); },
      [this] { return set_environment(); },
      [this] { return set_camera(); },
      [this] { return set_trace(); },
      [this] { return commit(); },
      [this] { return set_parameter(); },
      [this] { return set_host_lights(); },
      [this] { return get_lights(); },
      [this] { return next_tile(); },
      [this] { return groups_and_checkpoint(); },
      [this] { return ask(); },
      [this] { return release_one(); },
      [this] { return state(); },
      [this] { return build_accel(); },
      [this] { return trace(); },
      [this] { return ask_accel(); },
      [this] { return create_device(); },
  };
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  Session(data, size).run();
  return 0;
}
