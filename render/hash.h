// Hashes of what files of ours hold and were made for. Against mistakes, not against intent.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/fields.h"
#include "core/vec.h"

namespace lumicut {

uint64_t hash_bytes(uint64_t seed, const void* data, size_t size);

// Types whose bytes are their value: no padding, no pointers.
template <typename T>
inline constexpr bool kBytesAreValue = std::is_arithmetic_v<T> || std::is_enum_v<T>;
template <>
inline constexpr bool kBytesAreValue<Vec3f> = sizeof(Vec3f) == 3 * sizeof(float);
template <>
inline constexpr bool kBytesAreValue<Vec2f> = sizeof(Vec2f) == 2 * sizeof(float);
template <>
inline constexpr bool kBytesAreValue<Transform> = sizeof(Transform) == 12 * sizeof(float);

// Of a value whole: numbers, arrays, and structs that list their fields [core/fields.h].
template <typename T>
uint64_t hash_value(uint64_t seed, const T& value);

template <typename T>
uint64_t hash_value(uint64_t seed, const std::vector<T>& values) {
  if constexpr (kBytesAreValue<T>) {
    return hash_bytes(seed, values.data(), values.size() * sizeof(T));
  } else {
    seed = hash_value(seed, uint64_t{values.size()});
    for (const T& v : values) seed = hash_value(seed, v);
    return seed;
  }
}

template <typename T>
uint64_t hash_value(uint64_t seed, const std::optional<T>& value) {
  seed = hash_value(seed, value.has_value());
  return value ? hash_value(seed, *value) : seed;
}

// What is shared is hashed by its content.
template <typename T>
uint64_t hash_value(uint64_t seed, const std::shared_ptr<T>& value) {
  seed = hash_value(seed, value != nullptr);
  return value != nullptr ? hash_value(seed, *value) : seed;
}

inline uint64_t hash_value(uint64_t seed, const std::string& text) {
  return hash_bytes(seed, text.data(), text.size());
}

template <typename T>
uint64_t hash_value(uint64_t seed, const T& value) {
  if constexpr (kBytesAreValue<std::remove_all_extents_t<T>>) {
    return hash_bytes(seed, &value, sizeof(value));
  } else {
    for_each_field(value, [&](std::string_view, const auto& field) { seed = hash_value(seed, field); });
    return seed;
  }
}

}  // namespace lumicut
