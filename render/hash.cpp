#include "render/hash.h"

#include <cstring>

#include "core/rng.h"

namespace lumicut {

uint64_t hash_bytes(uint64_t seed, const void* data, size_t size) {
  const auto* bytes = static_cast<const uint8_t*>(data);
  uint64_t h = hash64(seed ^ size);
  for (; size >= 8; size -= 8, bytes += 8) {
    uint64_t word;
    std::memcpy(&word, bytes, 8);
    h = (h ^ word) * 0x9e3779b97f4a7c15ull;
    h ^= h >> 29;
  }
  uint64_t word = 0;
  if (size > 0) std::memcpy(&word, bytes, size);  // memcpy takes no null pointer, which empty arrays have
  return hash64(h ^ word);
}

}  // namespace lumicut
