// The growth rule: every descriptor at every struct_size. Each is handed over in a heap block of exactly that many
// bytes, so that a byte read or written beyond them is an error under AddressSanitizer.
#include <cstddef>
#include <cstring>
#include <functional>
#include <memory>

#include "box_scene.h"
#include "plugin/descriptors.h"
#include "tests/support/backends.h"

namespace {

using namespace box;
using lumicut::FieldSpan;

// test_abi.py compares them with lumicut.h.
template <typename T>
std::vector<FieldSpan> fields_of() {
  return {std::begin(lumicut::Descriptor<T>::fields), std::end(lumicut::Descriptor<T>::fields)};
}

template <typename T>
std::vector<unsigned char> bytes_of(const T& t) {
  std::vector<unsigned char> bytes(sizeof(T));
  std::memcpy(bytes.data(), &t, sizeof(T));
  return bytes;
}

// `size` bytes (at least those of struct_size) that say so, beginning with `content`, the rest `fill`.
std::unique_ptr<unsigned char[]> block(size_t size, const std::vector<unsigned char>& content, unsigned char fill) {
  const size_t allocated = std::max<size_t>(size, 4);
  std::unique_ptr<unsigned char[]> p(new unsigned char[allocated]);
  std::memset(p.get(), fill, allocated);
  std::copy_n(content.begin(), std::min(content.size(), size), p.get());
  const auto said = static_cast<uint32_t>(size);
  std::memcpy(p.get(), &said, sizeof(said));
  return p;
}

// What a library that knows only the fields ending within `size` would read.
std::vector<unsigned char> with_fields_within(const std::vector<unsigned char>& full,
                                              const std::vector<FieldSpan>& fields, size_t size) {
  std::vector<unsigned char> out(full.size(), 0);
  for (const FieldSpan& f : fields)
    if (f.offset + f.size <= size) std::memcpy(out.data() + f.offset, full.data() + f.offset, f.size);
  const auto said = static_cast<uint32_t>(full.size());
  std::memcpy(out.data(), &said, sizeof(said));
  return out;
}

struct Outcome {
  lumicut_result code;
  std::string text;
  bool operator==(const Outcome& o) const { return code == o.code && (code == LUMICUT_OK || text == o.text); }
};
std::ostream& operator<<(std::ostream& s, const Outcome& o) { return s << o.code << " " << o.text; }

using Call = std::function<lumicut_result(const void*)>;

Outcome outcome(const Call& call, const void* descriptor) {
  const lumicut_result code = call(descriptor);
  return {code, lumicut_last_error()};
}

void check_input(const std::string& name, const std::vector<unsigned char>& valid, const std::vector<FieldSpan>& fields,
                 const Call& call) {
  SCOPED_TRACE(name);
  ASSERT_EQ(fields.back().offset + fields.back().size, valid.size());
  for (size_t size = 0; size <= valid.size() + 64; ++size) {
    SCOPED_TRACE("struct_size " + std::to_string(size));
    const Outcome got = outcome(call, block(size, valid, 0).get());
    if (size < 4) {
      EXPECT_EQ(got.code, LUMICUT_INVALID_ARGUMENT);
      EXPECT_NE(got.text.find("struct_size"), std::string::npos) << got.text;
      continue;
    }
    const Outcome expected = outcome(call, with_fields_within(valid, fields, size).data());
    EXPECT_EQ(got, expected);
    if (size >= valid.size()) {
      EXPECT_EQ(got.code, LUMICUT_OK) << got.text;
    }
    if (size > valid.size()) {
      auto unknown = block(size, valid, 0);
      unknown[size - 1] = 1;
      EXPECT_EQ(call(unknown.get()), LUMICUT_UNSUPPORTED) << lumicut_last_error();
    }
  }
  // Sizes that no descriptor has are refused before anything behind them is read.
  for (const uint32_t absurd : {4097u, 0x7fffffffu, 0xffffffffu}) {
    auto b = block(valid.size(), valid, 0);
    std::memcpy(b.get(), &absurd, sizeof(absurd));
    EXPECT_EQ(call(b.get()), LUMICUT_INVALID_ARGUMENT);
  }
  EXPECT_EQ(call(nullptr), name == "lumicut_scene_desc" || name == "lumicut_environment" || name == "lumicut_trace"
                               ? LUMICUT_OK
                               : LUMICUT_INVALID_ARGUMENT);
}

void check_output(const std::string& name, size_t known, const std::vector<FieldSpan>& fields,
                  const std::function<lumicut_result(void*)>& call) {
  SCOPED_TRACE(name);
  ASSERT_EQ(fields.back().offset + fields.back().size, known);
  const auto full = block(known, {}, 0);
  ASSERT_EQ(call(full.get()), LUMICUT_OK) << lumicut_last_error();
  for (size_t size = 0; size <= known + 64; ++size) {
    SCOPED_TRACE("struct_size " + std::to_string(size));
    const auto b = block(size, {}, 0xab);
    if (size < 4) {
      EXPECT_EQ(call(b.get()), LUMICUT_INVALID_ARGUMENT);
      continue;
    }
    ASSERT_EQ(call(b.get()), LUMICUT_OK) << lumicut_last_error();
    uint32_t said = 0;
    std::memcpy(&said, b.get(), sizeof(said));
    EXPECT_EQ(said, size) << "struct_size is the host's";
    for (const FieldSpan& f : fields) {
      if (f.offset == 0) continue;
      for (size_t i = f.offset; i < std::min(size, f.offset + f.size); ++i)
        ASSERT_EQ(b[i], f.offset + f.size <= size ? full[i] : 0xab) << "byte " << i;
    }
    for (size_t i = known; i < size; ++i) ASSERT_EQ(b[i], 0) << "byte " << i;
  }
  EXPECT_EQ(call(nullptr), LUMICUT_INVALID_ARGUMENT);
}

TEST(Abi, DescriptorsOfAnySizeAreReadByTheGrowthRule) {
  const api::Device device(1);
  api::Scene s = scene(device);

  {
    using T = lumicut_device_desc;
    auto d = make<T>();
    d.abi_major = LUMICUT_ABI_MAJOR, d.threads = 1, d.verbosity = 2;
    check_input("lumicut_device_desc", bytes_of(d), fields_of<T>(), [](const void* p) {
      lumicut_device made = nullptr;
      const auto code = lumicut_device_create(static_cast<const T*>(p), &made);
      lumicut_release(made);
      return code;
    });
  }
  const Geometry g = geometry();
  {
    using T = lumicut_accel_desc;
    auto d = make<T>();
    d.robust = 1, d.kind = lumicut::test::last_backend();
    d.positions = g.positions.data(), d.position_count = g.positions.size() / 3, d.position_stride = 12;
    d.indices = g.indices.data(), d.triangle_count = g.indices.size() / 3;
    check_input("lumicut_accel_desc", bytes_of(d), fields_of<T>(), [&](const void* p) {
      lumicut_accel made = nullptr;
      const auto code = lumicut_accel_build(device.get(), static_cast<const T*>(p), &made);
      lumicut_release(made);
      return code;
    });
  }
  {
    using T = lumicut_scene_desc;
    auto d = make<T>();
    d.robust = 1, d.accel = "bvh", d.builder = "sweep";
    check_input("lumicut_scene_desc", bytes_of(d), fields_of<T>(), [&](const void* p) {
      lumicut_scene made = nullptr;
      const auto code = lumicut_scene_create(device.get(), static_cast<const T*>(p), &made);
      lumicut_release(made);
      return code;
    });
  }
  {
    using T = lumicut_texture;
    const unsigned char pixels[12] = {};
    auto d = make<T>();
    d.width = 2, d.height = 2, d.channels = 3, d.format = LUMICUT_UINT8, d.flags = LUMICUT_SRGB, d.pixels = pixels;
    check_input("lumicut_texture", bytes_of(d), fields_of<T>(),
                [&](const void* p) { return lumicut_scene_set_textures(s.get(), static_cast<const T*>(p), 1); });
  }
  {
    using T = lumicut_material;
    check_input("lumicut_material", bytes_of(materials()[3]), fields_of<T>(),
                [&](const void* p) { return lumicut_scene_set_materials(s.get(), static_cast<const T*>(p), 1); });
  }
  {
    using T = lumicut_mesh;
    auto d = g.mesh();
    const float transform[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    d.transforms = transform, d.transform_count = 1, d.material = 1, d.group = 2, d.mask = 3;
    d.not_lit_by = 1, d.not_blocking = 2, d.receivers = 1, d.blockers = 2;
    check_input("lumicut_mesh", bytes_of(d), fields_of<T>(),
                [&](const void* p) { return lumicut_scene_add_mesh(s.get(), static_cast<const T*>(p), nullptr); });
  }
  {
    using T = lumicut_profile;
    const float angles[2] = {0, 1}, values[2] = {3, 1};
    auto d = make<T>();
    d.vertical_count = 2, d.horizontal_count = 1, d.vertical = angles, d.horizontal = angles, d.values = values;
    check_input("lumicut_profile", bytes_of(d), fields_of<T>(),
                [&](const void* p) { return lumicut_scene_set_profiles(s.get(), static_cast<const T*>(p), 1); });
  }
  {
    using T = lumicut_light;
    auto d = lamp();
    d.spread = 1, d.mask = LUMICUT_GLOSSY_RAYS, d.receivers = 1, d.blockers = 2;
    check_input("lumicut_light", bytes_of(d), fields_of<T>(),
                [&](const void* p) { return lumicut_scene_set_lights(s.get(), static_cast<const T*>(p), 1); });
  }
  {
    using T = lumicut_environment;
    auto d = make<T>();
    d.color[0] = 1, d.flags = LUMICUT_HIDDEN, d.mask = LUMICUT_DIFFUSE_RAYS,
    d.world_to_map[0] = d.world_to_map[4] = d.world_to_map[8] = 1;
    check_input("lumicut_environment", bytes_of(d), fields_of<T>(),
                [&](const void* p) { return lumicut_scene_set_environment(s.get(), static_cast<const T*>(p)); });
  }
  {
    using T = lumicut_camera;
    auto d = camera();
    d.pixel_aspect = 1, d.lens_radius = 0.1f, d.focus_distance = 2;
    check_input("lumicut_camera", bytes_of(d), fields_of<T>(),
                [&](const void* p) { return lumicut_scene_set_camera(s.get(), static_cast<const T*>(p)); });
  }
  {
    using T = lumicut_trace;
    auto d = make<T>();
    d.intersect = [](void*, lumicut_rayhit*, uint64_t) {};
    d.occluded = [](void*, lumicut_ray*, uint64_t) {};
    check_input("lumicut_trace", bytes_of(d), fields_of<T>(),
                [&](const void* p) { return lumicut_scene_set_trace(s.get(), static_cast<const T*>(p)); });
  }
  {
    using T = lumicut_render_desc;
    const api::Scene fresh = scene(device);
    const api::Integrator i = integrator(device, 10);
    auto d = make<T>();
    d.width = 16, d.height = 16, d.samples = 1, d.crop[2] = d.crop[3] = 8, d.tile_size = 8;
    check_input("lumicut_render_desc", bytes_of(d), fields_of<T>(), [&](const void* p) {
      lumicut_render made = nullptr;
      const auto code = lumicut_render_start(i.get(), fresh.get(), static_cast<const T*>(p), &made);
      lumicut_release(made);
      return code;
    });
    const api::Render r(i, fresh, d);
    r.wait();
    using Tile = lumicut_tile;
    auto tile = make<Tile>();
    tile.x1 = tile.y1 = 4;
    check_input("lumicut_tile", bytes_of(tile), fields_of<Tile>(), [&](const void* p) {
      float pixels[8 * 8];
      if (p == nullptr) return lumicut_result{LUMICUT_INVALID_ARGUMENT};  // NULL is the crop
      return lumicut_render_read(r.get(), "depth", static_cast<const Tile*>(p), pixels);
    });
  }
}

TEST(Abi, DescriptorsThatTheLibraryFillsAreFilledAsFarAsTheyReach) {
  const api::Device device(1);
  const api::Scene s = scene(device);
  const api::Integrator i = integrator(device, 10);
  const api::Render r(i, s, frame(16, 16));
  r.wait();
  lumicut_tile drained = make<lumicut_tile>();
  while (r.next_tile(drained)) {
  }
  const Geometry g = geometry();
  auto d = make<lumicut_accel_desc>();
  d.kind = lumicut::test::last_backend(), d.positions = g.positions.data(), d.position_count = g.positions.size() / 3;
  d.indices = g.indices.data(), d.triangle_count = g.indices.size() / 3;
  const api::Accel accel(device, d);

  {
    using T = lumicut_status;
    check_output("lumicut_status", sizeof(T), fields_of<T>(),
                 [&](void* p) { return lumicut_get_status(r.get(), static_cast<T*>(p)); });
  }
  {
    using T = lumicut_accel_info;
    check_output("lumicut_accel_info", sizeof(T), fields_of<T>(),
                 [&](void* p) { return lumicut_accel_get_info(accel.get(), static_cast<T*>(p)); });
  }
  {
    using T = lumicut_integrator_info;
    check_output("lumicut_integrator_info", sizeof(T), fields_of<T>(),
                 [&](void* p) { return lumicut_get_integrator_info(0, static_cast<T*>(p)); });
  }
  {
    using T = lumicut_param_info;
    check_output("lumicut_param_info", sizeof(T), fields_of<T>(),
                 [&](void* p) { return lumicut_get_param_info("exhaustive", 0, static_cast<T*>(p)); });
  }
  {
    using T = lumicut_channel_info;
    check_output("lumicut_channel_info", sizeof(T), fields_of<T>(),
                 [&](void* p) { return lumicut_get_channel_info(0, static_cast<T*>(p)); });
  }
  {
    using T = lumicut_tile;
    check_output("lumicut_tile", sizeof(T), fields_of<T>(),
                 [&](void* p) { return lumicut_render_next_tile(r.get(), static_cast<T*>(p)); });
  }
}

TEST(Abi, FieldEndingAtStructSizeIsReadAndOneCutShortIsNot) {
  const api::Device device(1);
  const api::Scene s = scene(device);
  auto l = lamp();
  l.spread = NAN;
  l.struct_size = offsetof(lumicut_light, spread) + sizeof(l.spread);
  EXPECT_CODE(lumicut_scene_set_lights(s.get(), &l, 1), LUMICUT_INVALID_ARGUMENT, "lumicut_light[0].spread: nan");
  for (uint32_t cut = 1; cut <= 4; ++cut) {
    l.struct_size = offsetof(lumicut_light, spread) + sizeof(l.spread) - cut;
    EXPECT_EQ(lumicut_scene_set_lights(s.get(), &l, 1), LUMICUT_OK) << lumicut_last_error();
  }
}

TEST(Abi, ArraysAreStridedByTheFirstElementsStructSize) {
  struct Longer {
    lumicut_light light;
    uint32_t later[4];
  };
  const api::Device device(1);
  const api::Scene s = scene(device);
  std::vector<Longer> lights(3);
  for (Longer& l : lights) {
    l = {lamp(), {}};
    l.light.struct_size = sizeof(Longer);
  }
  EXPECT_EQ(lumicut_scene_set_lights(s.get(), &lights[0].light, 3), LUMICUT_OK) << lumicut_last_error();
  lights[2].light.color[1] = -1;
  EXPECT_CODE(lumicut_scene_set_lights(s.get(), &lights[0].light, 3), LUMICUT_INVALID_ARGUMENT,
              "lumicut_light[2].color[1]: -1 is not in [0, inf)");
  lights[2].light.color[1] = 1;
  lights[1].later[3] = 7;
  EXPECT_CODE(lumicut_scene_set_lights(s.get(), &lights[0].light, 3), LUMICUT_UNSUPPORTED, "lumicut_light[1]");
  lights[1].later[3] = 0;
  lights[1].light.struct_size = sizeof(lumicut_light);
  EXPECT_CODE(lumicut_scene_set_lights(s.get(), &lights[0].light, 3), LUMICUT_INVALID_ARGUMENT,
              "lumicut_light[1].struct_size");
}

}  // namespace
