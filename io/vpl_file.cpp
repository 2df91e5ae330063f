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
constexpr uint32_t kVersion = 2;

// Version 1 ends before emitter_samples, and its records before the origin.
struct Header {
  char magic[8];
  uint32_t version, record_size;
  uint64_t count, light_paths, emitter_samples;
};
struct Record {
  lumicut_vpl light;
  lumicut_vpl_origin origin;
};
constexpr size_t kHeaderSize[] = {offsetof(Header, emitter_samples), sizeof(Header)};
constexpr size_t kRecordSize[] = {offsetof(Record, origin), sizeof(Record)};
static_assert(kHeaderSize[0] == 32 && kHeaderSize[1] == 40 && kRecordSize[0] == 64 && kRecordSize[1] == 112);

struct PeerRecord {
  float position[3], minus_normal[3], intensity[3];
};
static_assert(sizeof(PeerRecord) == 36);

// What other programs leave in fields of their own or scale as they like; values are the library's to check.
void tidy(lumicut_vpl& light) {
  if (light.kind != LUMICUT_VPL_SPOT) light.profile = 0;
  if (light.kind == LUMICUT_VPL_OMNI) return;
  double length = 0;
  for (const float n : light.normal) length += double{n} * n;
  length = std::sqrt(length);
  if (std::isfinite(length) && length >= 1e-6 && std::abs(length - 1) > 1e-6)  // unit vectors stay, bit for bit
    for (float& n : light.normal) n = static_cast<float>(double{n} / length);
}

// A file that starts with our name.
api::VplSet read_own(const std::string& path, const std::string& bytes) {
  Header header{};
  const auto ends_early = [&] {
    throw FileError(path, fmt::format("ends within its header ({} bytes)", bytes.size()));
  };
  if (bytes.size() < kHeaderSize[0]) ends_early();
  std::memcpy(&header, bytes.data(), kHeaderSize[0]);
  if (header.version < 1 || header.version > kVersion)
    throw FileError(path, fmt::format("version is {}, but 1 to {} are read", header.version, kVersion));
  const size_t header_size = kHeaderSize[header.version - 1], record_size = kRecordSize[header.version - 1];
  if (header.record_size != record_size)
    throw FileError(path, fmt::format("record size is {}, but must be {}", header.record_size, record_size));
  if (bytes.size() < header_size) ends_early();
  std::memcpy(&header, bytes.data(), header_size);
  const uint64_t room = bytes.size() - header_size;
  if (room % record_size != 0 || room / record_size != header.count)
    throw FileError(
        path, fmt::format("says {} lights, but holds {} bytes of them, {} each", header.count, room, record_size));
  api::VplSet set;
  set.lights.reserve(header.count), set.origins.reserve(header.count);
  for (uint64_t i = 0; i < header.count; ++i) {
    Record record{};
    std::memcpy(&record, bytes.data() + header_size + i * record_size, record_size);
    set.lights.push_back(record.light), set.origins.push_back(record.origin);
  }
  if (header.version == 1) return set;
  set.light_paths = header.light_paths, set.emitter_samples = header.emitter_samples;
  return set;
}

// The peer's: a count and bare records of position, MINUS the normal, intensity.
api::VplSet read_peers(const std::string& path, const std::string& bytes) {
  uint64_t count = 0;
  if (bytes.size() >= 8) std::memcpy(&count, bytes.data(), 8);
  const uint64_t room = bytes.size() < 8 ? 0 : bytes.size() - 8;
  if (bytes.size() < 8 || room % sizeof(PeerRecord) != 0 || room / sizeof(PeerRecord) != count)
    throw FileError(
        path,
        fmt::format(
            "is no VPL file: neither starts with LUMIVPL, nor do its {} bytes hold a count and as many records of 36",
            bytes.size()));
  api::VplSet set;
  set.lights.resize(count), set.origins.resize(count);
  for (uint64_t i = 0; i < count; ++i) {
    PeerRecord record;
    std::memcpy(&record, bytes.data() + 8 + i * sizeof(record), sizeof(record));
    lumicut_vpl& light = set.lights[i];
    light.kind = LUMICUT_VPL_ORIENTED;
    for (int k = 0; k < 3; ++k) {
      light.position[k] = record.position[k];
      light.normal[k] = -record.minus_normal[k];
      light.intensity[k] = record.intensity[k];
    }
  }
  return set;
}

}  // namespace

api::VplSet read_vpls(const std::string& path) {
  const std::string bytes = read_whole_file(path, uint64_t{64} << 30);
  const bool own = bytes.size() >= sizeof(kMagic) && std::memcmp(bytes.data(), kMagic, sizeof(kMagic)) == 0;
  api::VplSet set = own ? read_own(path, bytes) : read_peers(path, bytes);
  for (lumicut_vpl& light : set.lights) tidy(light);
  return set;
}

void upload_vpls(const api::Functions& library, lumicut_integrator integrator, const api::VplSet& set,
                 const std::string& path) {
  try {
    api::set_vpls(integrator, set, library);
  } catch (const api::Exception& error) {
    if (error.code() != LUMICUT_INVALID_ARGUMENT) throw;
    throw FileError(path, error.what());
  }
}

void write_vpls(const std::string& path, const api::VplSet& set) {
  Header header{};
  std::memcpy(header.magic, kMagic, sizeof(kMagic));
  header.version = kVersion;
  header.record_size = sizeof(Record);
  header.count = set.lights.size();
  header.light_paths = set.light_paths, header.emitter_samples = set.emitter_samples;
  std::string bytes(sizeof(header) + set.lights.size() * sizeof(Record), '\0');
  std::memcpy(bytes.data(), &header, sizeof(header));
  for (size_t i = 0; i < set.lights.size(); ++i) {
    const Record record = {set.lights[i], set.origins.empty() ? lumicut_vpl_origin{} : set.origins[i]};
    std::memcpy(bytes.data() + sizeof(header) + i * sizeof(record), &record, sizeof(record));
  }
  write_whole_file(path, bytes);
}

}  // namespace lumicut::io
