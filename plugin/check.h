// Checks of what a host hands over. Texts name field and value: "lumicut_material[3].diffuse[1]: nan is not in [0, 1]".
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <string>

#include "accel/accel.h"
#include "core/number_text.h"
#include "core/vec.h"

namespace lumicut {

// The structure that fields belong to, for texts. Costs nothing until a check fails.
class FieldValidator {
 public:
  explicit FieldValidator(const char* type) : type_(type) {}
  FieldValidator(const char* type, uint64_t index) : type_(type), index_(static_cast<int64_t>(index)) {}

  std::string field(const char* name, int64_t k = -1) const;
  // "field: <what>" as INVALID_ARGUMENT, or UNSUPPORTED.
  [[noreturn]] void fail(const char* name, const std::string& what, int64_t k = -1) const;
  [[noreturn]] void fail_unknown(const char* name, const std::string& what, int64_t k = -1) const;

  void finite(const char* name, float v, int64_t k = -1) const {
    if (!std::isfinite(v)) fail(name, number_text(v) + " is not finite", k);
  }
  void finite(const char* name, const float (&v)[3]) const {
    for (int i = 0; i < 3; ++i) finite(name, v[i], i);
  }
  // Of a place or a length in the world.
  void coordinate(const char* name, float v, int64_t k = -1) const {
    if (!(std::abs(v) <= kLargestCoordinate)) range(name, v, -kLargestCoordinate, kLargestCoordinate, k);
  }
  void coordinate(const char* name, const float (&v)[3]) const {
    for (int i = 0; i < 3; ++i) coordinate(name, v[i], i);
  }
  // In [low, high]; NaN never is. An infinite `high` stands for "finite".
  void range(const char* name, float v, float low, float high, int64_t k = -1) const {
    if (!(v >= low && v <= high) || std::isinf(v)) fail_range(name, v, low, high, k);
  }
  void range(const char* name, const float (&v)[3], float low, float high) const {
    for (int i = 0; i < 3; ++i) range(name, v[i], low, high, i);
  }
  void not_negative(const char* name, float v) const { range(name, v, 0.0f, std::numeric_limits<float>::infinity()); }
  void not_negative(const char* name, const float (&v)[3]) const {
    range(name, v, 0.0f, std::numeric_limits<float>::infinity());
  }
  void integer(const char* name, uint64_t v, uint64_t low, uint64_t high) const;
  // Bits beyond `known` are UNSUPPORTED.
  void flags(const char* name, uint32_t v, uint32_t known) const;
  // Finite and longer than 0; returned with unit length.
  Vec3f direction(const char* name, const float (&v)[3]) const;

 private:
  [[noreturn]] void fail_range(const char* name, float v, float low, float high, int64_t k) const;

  const char* type_;
  int64_t index_ = -1;
};

}  // namespace lumicut
