// Bytes that end in a checksum check: a fuzzer that changes them would never get past it. So inputs are edits of good
// bytes, and the checksum is put right where the input says so.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <vector>

#include "render/hash.h"
#include "tests/fuzz/fuzz.h"

namespace lumicut::fuzz {

// Where a format has what the rest is held against. The checksum is of the header with 0 in its place, then of the body.
struct Layout {
  size_t header, checksum;
  size_t size = 0;  // where it says how long all is; 0: nowhere
};

inline void put_right(std::vector<uint8_t>& bytes, const Layout& at) {
  if (bytes.size() < at.header) return;
  const auto set = [&](size_t place, uint64_t value) { std::memcpy(bytes.data() + place, &value, sizeof(value)); };
  if (at.size != 0) set(at.size, bytes.size());
  set(at.checksum, 0);
  set(at.checksum,
      hash_bytes(hash_bytes(0, bytes.data(), at.header), bytes.data() + at.header, bytes.size() - at.header));
}

// Ends the process where good bytes are laid out otherwise: the target would test nothing.
inline void check_layout(std::vector<uint8_t> good, const Layout& layout) {
  const auto before = good;
  put_right(good, layout);
  if (good != before) finding("this target does not know the format's header any more");
}

// First byte: bit 0, put the checksum right; bit 1, the rest is the whole body instead of edits. An edit is four bytes:
// place (from the end where its top bit is set), new byte, and 1 to cut there, 2 to insert zeros, else to replace.
inline std::vector<uint8_t> edited(const std::vector<uint8_t>& good, const Layout& layout, const uint8_t* data,
                                   size_t size) {
  if (size == 0) return {};
  const uint8_t how = *data++;
  --size;
  std::vector<uint8_t> bytes = good;
  if ((how & 2) != 0) {
    bytes.resize(layout.header);
    bytes.insert(bytes.end(), data, data + size);
  } else {
    for (; size >= 4 && !bytes.empty(); data += 4, size -= 4) {
      uint16_t place = 0;
      std::memcpy(&place, data, 2);
      size_t at = std::min<size_t>(place & 0x7fffu, bytes.size() - 1);
      if ((place & 0x8000u) != 0) at = bytes.size() - 1 - at;
      if (data[3] == 1)
        bytes.resize(at);
      else if (data[3] == 2)
        bytes.insert(bytes.begin() + static_cast<std::ptrdiff_t>(at), data[2], uint8_t{0});
      else
        bytes[at] = data[2];
    }
  }
  if ((how & 1) != 0) put_right(bytes, layout);
  return bytes;
}

}  // namespace lumicut::fuzz
