#include "plugin/check.h"

#include "core/error.h"

namespace lumicut {

std::string FieldValidator::field(const char* name, int64_t k) const {
  std::string text = type_;
  if (index_ >= 0) text += "[" + number_text(index_) + "]";
  text += std::string(".") + name;
  if (k >= 0) text += "[" + number_text(k) + "]";
  return text;
}

void FieldValidator::fail(const char* name, const std::string& what, int64_t k) const {
  throw Error(ErrorCode::invalid_argument, field(name, k) + ": " + what);
}

void FieldValidator::fail_unknown(const char* name, const std::string& what, int64_t k) const {
  throw Error(ErrorCode::unsupported, field(name, k) + ": " + what);
}

void FieldValidator::fail_range(const char* name, float v, float low, float high, int64_t k) const {
  fail(
      name,
      number_text(v) + " is not in [" + number_text(low) + ", " + (std::isinf(high) ? "inf)" : number_text(high) + "]"),
      k);
}

void FieldValidator::integer(const char* name, uint64_t v, uint64_t low, uint64_t high) const {
  if (v < low || v > high)
    fail(name, number_text(v) + " is not in [" + number_text(low) + ", " + number_text(high) + "]");
}

void FieldValidator::flags(const char* name, uint32_t v, uint32_t known) const {
  if ((v & ~known) != 0)
    fail_unknown(name, number_text(uint64_t{v}) +
                           " has bits that are not known here (known: " + number_text(uint64_t{known}) + ")");
}

Vec3f FieldValidator::direction(const char* name, const float (&v)[3]) const {
  finite(name, v);
  const Vec3d d{v[0], v[1], v[2]};  // double: the square of a tiny float is 0
  const double l = length(d);
  if (!(l > 0.0)) fail(name, "(0, 0, 0) has no direction");
  return {static_cast<float>(d.x / l), static_cast<float>(d.y / l), static_cast<float>(d.z / l)};
}

}  // namespace lumicut
