#include "io/vpl_file.h"

#include <cmath>
#include <cstring>

#include "tests/io/temporary_folder.h"

namespace lumicut::io {
namespace {

lumicut_vpl oriented(float x) {
  lumicut_vpl light{};
  light.kind = LUMICUT_VPL_ORIENTED;
  light.position[0] = x;
  light.normal[1] = 1;
  light.intensity[0] = 1, light.intensity[1] = 2, light.intensity[2] = 3;
  return light;
}

lumicut_vpl_origin area_origin() {
  lumicut_vpl_origin origin{};
  origin.source = LUMICUT_SOURCE_AREA, origin.offset = 0.1f, origin.area = 2;
  return origin;
}

std::string bytes_of(const auto& value) { return {reinterpret_cast<const char*>(&value), sizeof(value)}; }

// Of version 1, whose records are 64 bytes.
std::string own_header(uint64_t count, uint32_t version = 1, uint32_t record = 64) {
  return "LUMIVPL\n" + bytes_of(version) + bytes_of(record) + bytes_of(count) + bytes_of(uint64_t{0});
}

// Of version 2: light paths and samples of emitters, then records with their origins.
std::string header2(uint64_t count, uint64_t emitter_samples = 0) {
  return own_header(count, 2, 112) + bytes_of(emitter_samples);
}

template <typename T>
bool same_bytes(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0;
}

api::VplSet hundred() {
  api::VplSet set;
  set.lights.resize(100);
  for (int i = 0; i < 100; ++i) {
    auto& l = set.lights[static_cast<size_t>(i)] = oriented(0.1f * static_cast<float>(i));
    const float a = static_cast<float>(i);
    l.normal[0] = std::sin(a), l.normal[1] = std::cos(a);
    l.kind = static_cast<uint32_t>(i % 5);
    l.group = 7;
    l.cos_outer = 0.5f, l.blend = 0.1f, l.spot_cosine = 1, l.spread_tan = 2;
  }
  return set;
}

TEST(VplFile, LightsComeBackBitForBit) {
  const TemporaryFolder folder;
  api::VplSet set = hundred();
  for (uint32_t i = 0; i < 100; ++i)
    set.origins.push_back({i % 3,
                           1e-4f * static_cast<float>(i),
                           i % 3 == LUMICUT_SOURCE_AREA ? 0.3f : 0.0f,
                           {0, 0, 1},
                           0.5f,
                           0.1f,
                           1,
                           0.5f,
                           0.3f,
                           0.9f});
  set.light_paths = 1234, set.emitter_samples = 40;
  write_vpls(folder / "a.vpl", set);
  const auto read = read_vpls(folder / "a.vpl");
  EXPECT_TRUE(same_bytes(read.lights, set.lights));
  EXPECT_TRUE(same_bytes(read.origins, set.origins));
  EXPECT_EQ(read.light_paths, 1234u);
  EXPECT_EQ(read.emitter_samples, 40u);
  EXPECT_EQ(std::filesystem::file_size(folder / "a.vpl"), 40u + 11200u);
  write_vpls(folder / "none.vpl", {});
  EXPECT_TRUE(read_vpls(folder / "none.vpl").lights.empty());
}

TEST(VplFile, OfVersion1AndLightsWithoutOriginsNothingIsKnown) {
  const TemporaryFolder folder;
  const api::VplSet set = hundred();
  std::string first = own_header(100);
  for (const auto& light : set.lights) first += bytes_of(light);
  folder.write("1.vpl", first);
  write_vpls(folder / "2.vpl", set);
  for (const char* name : {"1.vpl", "2.vpl"}) {
    const auto read = read_vpls(folder / name);
    EXPECT_TRUE(same_bytes(read.lights, set.lights)) << name;
    EXPECT_TRUE(same_bytes(read.origins, std::vector<lumicut_vpl_origin>(100))) << name;
    EXPECT_EQ(read.emitter_samples, 0u);
  }
}

TEST(VplFile, ThePeersNormalsAreTurned) {
  const TemporaryFolder folder;
  const float record[9] = {1, 2, 3, 0, -1, 0, 4, 5, 6};
  const auto lights = read_vpls(folder.write("peer.vpl", bytes_of(uint64_t{1}) + bytes_of(record))).lights;
  ASSERT_EQ(lights.size(), 1u);
  EXPECT_EQ(lights[0].kind, uint32_t{LUMICUT_VPL_ORIENTED});
  EXPECT_EQ(lights[0].normal[1], 1.0f);
  EXPECT_EQ(lights[0].position[2], 3.0f);
  EXPECT_EQ(lights[0].intensity[2], 6.0f);
}

TEST(VplFile, WrongLengthsAndVersionsAreNamed) {
  const TemporaryFolder folder;
  const auto error = [&](const std::string& bytes) {
    return error_of([&] { read_vpls(folder.write("bad.vpl", bytes)); });
  };
  expect_in(error(""), {"bad.vpl", "no VPL file"});
  expect_in(error("hello world, this is no light"), {"no VPL file"});
  expect_in(error("LUMIVPL\n"), {"ends within its header"});
  expect_in(error(own_header(0, 0)), {"version is 0"});
  expect_in(error(own_header(0, 3)), {"version is 3"});
  expect_in(error(own_header(0, 1, 60)), {"record size is 60"});
  expect_in(error(own_header(0, 2, 64)), {"record size is 64", "112"});
  expect_in(error(own_header(0, 2, 112)), {"ends within its header"});
  expect_in(error(own_header(2) + bytes_of(oriented(1))), {"says 2 lights", "64 bytes"});
  expect_in(error(own_header(UINT64_MAX) + bytes_of(oriented(1))), {"18446744073709551615"});
  expect_in(error(own_header(1) + bytes_of(oriented(1)).substr(0, 40)), {"40 bytes"});
  expect_in(error(bytes_of(uint64_t{1} << 60) + std::string(36, '\0')), {"no VPL file"});
}

TEST(VplFile, RecordsWithOriginsAreCounted) {
  const TemporaryFolder folder;
  const auto error = [&](const std::string& bytes) {
    return error_of([&] { read_vpls(folder.write("bad.vpl", bytes)); });
  };
  const std::string light = bytes_of(oriented(0)), origin = bytes_of(area_origin());
  EXPECT_EQ(read_vpls(folder.write("good.vpl", header2(1, 1) + light + origin)).origins[0].area, 2);
  expect_in(error(header2(2, 2) + light + origin), {"bad.vpl", "says 2 lights", "112 bytes"});
  expect_in(error(header2(1, 1) + light + origin.substr(0, 8)), {"says 1 lights", "72 bytes"});
}

// By the library, in its words with the file's name.
TEST(VplFile, WrongValuesAreNamedWithRecordAndField) {
  const TemporaryFolder folder;
  const api::Device device(1);
  const api::Integrator integrator(device, "exhaustive");
  const auto error = [&](const lumicut_vpl& light, const lumicut_vpl_origin& origin) {
    const std::string path = folder.write("bad.vpl", header2(2, 1) + bytes_of(oriented(0)) + bytes_of(area_origin()) +
                                                         bytes_of(light) + bytes_of(origin));
    return error_of([&] { upload_vpls(api::linked(), integrator.get(), read_vpls(path), path); });
  };
  const auto light = [&](auto change) {
    lumicut_vpl bad = oriented(1);
    change(bad);
    return error(bad, {});
  };
  expect_in(light([](auto& l) { l.position[1] = NAN; }), {"bad.vpl", "lumicut_vpl[1].position", "nan"});
  expect_in(light([](auto& l) { l.intensity[0] = -1; }), {"lumicut_vpl[1].intensity", "-1"});
  expect_in(light([](auto& l) { l.intensity[0] = INFINITY; }), {"lumicut_vpl[1].intensity", "inf"});
  expect_in(light([](auto& l) { l.normal[1] = 0; }), {"lumicut_vpl[1].normal", "length 0"});
  expect_in(light([](auto& l) { l.kind = 9; }), {"lumicut_vpl[1].kind", "9"});
  expect_in(light([](auto& l) { l.kind = LUMICUT_VPL_SPHERE, l.cos_outer = 0; }), {"lumicut_vpl[1].cos_outer", "0"});
  expect_in(light([](auto& l) { l.kind = LUMICUT_VPL_SPOT, l.spread_tan = NAN; }),
            {"lumicut_vpl[1].spread_tan", "nan"});
  const auto spoilt = [&](auto change) {
    lumicut_vpl_origin bad{};
    change(bad);
    return error(oriented(1), bad);
  };
  expect_in(spoilt([](auto& o) { o.source = 3; }), {"bad.vpl", "lumicut_vpl_origin[1].source", "3"});
  expect_in(spoilt([](auto& o) { o.offset = NAN; }), {"lumicut_vpl_origin[1].offset", "nan"});
  expect_in(spoilt([](auto& o) { o.offset = -1; }), {"lumicut_vpl_origin[1].offset", "-1"});
  expect_in(spoilt([](auto& o) { o.area = 1; }), {"lumicut_vpl_origin[1].area", "1 is not 0"});
  expect_in(spoilt([](auto& o) { o.source = LUMICUT_SOURCE_AREA; }), {"lumicut_vpl_origin[1].area", "is 0"});
  expect_in(spoilt([](auto& o) { o.source = LUMICUT_SOURCE_AREA, o.area = INFINITY; }),
            {"lumicut_vpl_origin[1].area", "inf"});
}

TEST(VplFile, NormalsAreBroughtToLengthOne) {
  const TemporaryFolder folder;
  lumicut_vpl light = oriented(0);
  light.normal[1] = 5;
  EXPECT_EQ(read_vpls(folder.write("a.vpl", own_header(1) + bytes_of(light))).lights[0].normal[1], 1.0f);
}

}  // namespace
}  // namespace lumicut::io
