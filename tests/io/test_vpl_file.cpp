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

std::string bytes_of(const auto& value) { return {reinterpret_cast<const char*>(&value), sizeof(value)}; }

std::string own_header(uint64_t count, uint32_t version = 1, uint32_t record = 64) {
  return "LUMIVPL\n" + bytes_of(version) + bytes_of(record) + bytes_of(count) + bytes_of(uint64_t{0});
}

TEST(VplFile, LightsComeBackBitForBit) {
  const TemporaryFolder folder;
  std::vector<lumicut_vpl> lights(100);
  for (int i = 0; i < 100; ++i) {
    auto& l = lights[static_cast<size_t>(i)] = oriented(0.1f * static_cast<float>(i));
    const float a = static_cast<float>(i);
    l.normal[0] = std::sin(a), l.normal[1] = std::cos(a);
    l.kind = static_cast<uint32_t>(i % 5);
    l.group = 7;
    l.cos_outer = 0.5f, l.blend = 0.1f, l.spot_cosine = 1, l.spread_tan = 2;
  }
  write_vpls(folder / "a.vpl", lights.data(), lights.size());
  const auto read = read_vpls(folder / "a.vpl");
  ASSERT_EQ(read.size(), lights.size());
  EXPECT_EQ(std::memcmp(read.data(), lights.data(), 64 * lights.size()), 0);
  EXPECT_EQ(std::filesystem::file_size(folder / "a.vpl"), 32u + 6400u);
  write_vpls(folder / "none.vpl", nullptr, 0);
  EXPECT_TRUE(read_vpls(folder / "none.vpl").empty());
}

TEST(VplFile, ThePeersNormalsAreTurned) {
  const TemporaryFolder folder;
  const float record[9] = {1, 2, 3, 0, -1, 0, 4, 5, 6};
  const auto lights = read_vpls(folder.write("peer.vpl", bytes_of(uint64_t{1}) + bytes_of(record)));
  ASSERT_EQ(lights.size(), 1u);
  EXPECT_EQ(lights[0].kind, uint32_t{LUMICUT_VPL_ORIENTED});
  EXPECT_EQ(lights[0].normal[1], 1.0f);
  EXPECT_EQ(lights[0].position[2], 3.0f);
  EXPECT_EQ(lights[0].intensity[2], 6.0f);
}

TEST(VplFile, WrongFilesAreNamedWithRecordAndField) {
  const TemporaryFolder folder;
  const auto error = [&](const std::string& bytes) {
    return error_of([&] { read_vpls(folder.write("bad.vpl", bytes)); });
  };
  expect_in(error(""), {"bad.vpl", "no VPL file"});
  expect_in(error("hello world, this is no light"), {"no VPL file"});
  expect_in(error("LUMIVPL\n"), {"ends within its header"});
  expect_in(error(own_header(0, 2)), {"version is 2"});
  expect_in(error(own_header(0, 1, 60)), {"record size is 60"});
  expect_in(error(own_header(2) + bytes_of(oriented(1))), {"says 2 lights", "64 bytes"});
  expect_in(error(own_header(UINT64_MAX) + bytes_of(oriented(1))), {"18446744073709551615"});
  expect_in(error(own_header(1) + bytes_of(oriented(1)).substr(0, 40)), {"40 bytes"});
  expect_in(error(bytes_of(uint64_t{1} << 60) + std::string(36, '\0')), {"no VPL file"});
  const auto light = [&](auto change) {
    std::vector<lumicut_vpl> lights = {oriented(0), oriented(1)};
    change(lights[1]);
    return error(own_header(2) + bytes_of(lights[0]) + bytes_of(lights[1]));
  };
  expect_in(light([](auto& l) { l.position[1] = NAN; }), {"light 1", "position", "nan"});
  expect_in(light([](auto& l) { l.intensity[0] = -1; }), {"light 1", "intensity", "-1"});
  expect_in(light([](auto& l) { l.intensity[0] = INFINITY; }), {"light 1", "intensity", "inf"});
  expect_in(light([](auto& l) { l.normal[1] = 0; }), {"light 1", "normal", "(0, 0, 0)"});
  expect_in(light([](auto& l) { l.kind = 9; }), {"light 1", "kind is 9"});
  expect_in(light([](auto& l) { l.kind = LUMICUT_VPL_SPHERE, l.cos_outer = 0; }), {"light 1", "radius is 0"});
  expect_in(light([](auto& l) { l.spread_tan = NAN; }), {"light 1", "spot"});
}

TEST(VplFile, NormalsAreBroughtToLengthOne) {
  const TemporaryFolder folder;
  lumicut_vpl light = oriented(0);
  light.normal[1] = 5;
  EXPECT_EQ(read_vpls(folder.write("a.vpl", own_header(1) + bytes_of(light)))[0].normal[1], 1.0f);
}

}  // namespace
}  // namespace lumicut::io
