#include "io/vpl_file.h"

#include <fmt/format.h>

#include <bit>
#include <cmath>
#include <cstring>

#include "io/atomic_file.h"
#include "io/file_error.h"

namespace lumicut::io {

namespace {

static_assert(std::endian::native == std::endian::little, "VPL files are little-endian and copied as they are");

constexpr char kMagic[8] = {'L', 'U', 'M', 'I', 'V', 'P', 'L', '\n'};
constexpr uint32_t kVersion = 1;

struct Header {
  char magic[8];
  uint32_t version, record_size;
  uint64_t count, reserved;
};
static_assert(sizeof(Header) == 32 && sizeof(lumicut_vpl) == 64);

struct PeerRecord {
  float position[3], minus_normal[3], intensity[3];
};
static_assert(sizeof(PeerRecord) == 36);

bool all_finite(const float* values, int n) {
  for (int i = 0; i < n; ++i)
    if (!std::isfinite(values[i])) return false;
  return true;
}

void check(const std::string& path, uint64_t index, lumicut_vpl& light) {
  const auto fail = [&](const std::string& text) { throw FileError(path, fmt::format("light {}: {}", index, text)); };
  const auto shown = [](const float* v) { return fmt::format("({}, {}, {})", v[0], v[1], v[2]); };
  if (light.kind > LUMICUT_VPL_SPHERE) fail(fmt::format("kind is {}, but must be 0 to 4", light.kind));
  if (light.kind != LUMICUT_VPL_DIRECTIONAL && !all_finite(light.position, 3))
    fail("position is " + shown(light.position));
  for (const float i : light.intensity)
    if (!std::isfinite(i) || i < 0)
      fail("intensity is " + shown(light.intensity) + ", but must be finite and not negative");
  if (light.kind != LUMICUT_VPL_SPOT) light.profile = 0;
  if (!all_finite(&light.cos_outer, 4)) fail("the spot cone is not finite");
  if (light.kind == LUMICUT_VPL_SPHERE && !(light.cos_outer > 0))
    fail(fmt::format("the sphere's radius is {}, but must be above 0", light.cos_outer));
  if (light.kind == LUMICUT_VPL_OMNI) return;
  double length = 0;
  for (const float n : light.normal) length += double{n} * n;
  length = std::sqrt(length);
  if (!std::isfinite(length) || length < 1e-6) fail("normal is " + shown(light.normal) + ", but must be a direction");
  if (std::abs(length - 1) > 1e-6)  // a unit vector in float stays as it is, bit for bit
    for (float& n : light.normal) n = static_cast<float>(double{n} / length);
}

}  // namespace

std::vector<lumicut_vpl> read_vpls(const std::string& path) {
  const std::string bytes = read_whole_file(path, uint64_t{64} << 30);
  std::vector<lumicut_vpl> lights;
  Header header{};
  if (bytes.size() >= sizeof(kMagic) && std::memcmp(bytes.data(), kMagic, sizeof(kMagic)) == 0) {
    if (bytes.size() < sizeof(header))
      throw FileError(path, fmt::format("ends within its header ({} bytes)", bytes.size()));
    std::memcpy(&header, bytes.data(), sizeof(header));
    if (header.version != kVersion)
      throw FileError(path, fmt::format("version is {}, but {} is read", header.version, kVersion));
    if (header.record_size != sizeof(lumicut_vpl))
      throw FileError(path, fmt::format("record size is {}, but must be {}", header.record_size, sizeof(lumicut_vpl)));
    const uint64_t room = bytes.size() - sizeof(header);
    if (room % sizeof(lumicut_vpl) != 0 || room / sizeof(lumicut_vpl) != header.count)
      throw FileError(path, fmt::format("says {} lights, but holds {} bytes of them, {} each", header.count, room,
                                        sizeof(lumicut_vpl)));
    lights.resize(header.count);
    if (header.count > 0) std::memcpy(lights.data(), bytes.data() + sizeof(header), room);
  } else {
    // The peer's: a count and bare records of position, MINUS the normal, intensity.
    uint64_t count = 0;
    if (bytes.size() >= 8) std::memcpy(&count, bytes.data(), 8);
    const uint64_t room = bytes.size() < 8 ? 0 : bytes.size() - 8;
    if (bytes.size() < 8 || room % sizeof(PeerRecord) != 0 || room / sizeof(PeerRecord) != count)
      throw FileError(
          path,
          fmt::format(
              "is no VPL file: neither starts with LUMIVPL, nor do its {} bytes hold a count and as many records of 36",
              bytes.size()));
    lights.resize(count);
    for (uint64_t i = 0; i < count; ++i) {
      PeerRecord record;
      std::memcpy(&record, bytes.data() + 8 + i * sizeof(record), sizeof(record));
      lumicut_vpl& light = lights[i] = {};
      light.kind = LUMICUT_VPL_ORIENTED;
      for (int k = 0; k < 3; ++k) {
        light.position[k] = record.position[k];
        light.normal[k] = -record.minus_normal[k];
        light.intensity[k] = record.intensity[k];
      }
    }
  }
  for (uint64_t i = 0; i < lights.size(); ++i) check(path, i, lights[i]);
  return lights;
}

void write_vpls(const std::string& path, const lumicut_vpl* lights, uint64_t count) {
  Header header{};
  std::memcpy(header.magic, kMagic, sizeof(kMagic));
  header.version = kVersion;
  header.record_size = sizeof(lumicut_vpl);
  header.count = count;
  std::string bytes(sizeof(header) + count * sizeof(lumicut_vpl), '\0');
  std::memcpy(bytes.data(), &header, sizeof(header));
  if (count > 0) std::memcpy(bytes.data() + sizeof(header), lights, count * sizeof(lumicut_vpl));
  write_whole_file(path, bytes);
}

}  // namespace lumicut::io
