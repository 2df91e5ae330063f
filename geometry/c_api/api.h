// What both libraries of the C interface stand on: errors as codes, and arrays as spans.
#pragma once

#include <cmath>
#include <new>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/error.h"
#include "geometry/c_api/include/lumicut/lumicut_geometry.h"
#include "geometry/point2.h"

namespace lumicut::c_api {

template <typename Fn>
int guard(Fn&& fn) noexcept {
  try {
    fn();
    return LUMICUT_GEOMETRY_OK;
  } catch (const Error& e) {
    return lumicut_geometry_fail(static_cast<int>(e.code()), e.what());
  } catch (const std::bad_alloc&) {
    return lumicut_geometry_fail(LUMICUT_GEOMETRY_OUT_OF_MEMORY, "out of memory");
  } catch (const std::length_error&) {
    return lumicut_geometry_fail(LUMICUT_GEOMETRY_OUT_OF_MEMORY,
                                 "out of memory: a count is beyond what any memory holds");
  } catch (const std::exception& e) {
    return lumicut_geometry_fail(LUMICUT_GEOMETRY_INTERNAL, e.what());
  } catch (...) {
    return lumicut_geometry_fail(LUMICUT_GEOMETRY_INTERNAL, "an exception of unknown type");
  }
}

template <typename T>
T& required(T* pointer, const char* name) {
  if (pointer == nullptr) fail_argument(std::string(name) + " is NULL");
  return *pointer;
}

// `count` rows of `width` numbers. Indices are of 32 bits, so there are fewer rows than those.
template <typename T>
std::span<const T> array(const T* data, size_t count, size_t width, const char* name) {
  if (count != 0) required(data, name);
  if (count >= 0xffffffffu)
    fail_argument(std::string(name) + ": " + std::to_string(count) + " are more than 4294967294");
  return {data, count * width};
}

inline std::span<const Point2> points_of(const double* data, size_t count) {
  static_assert(sizeof(Point2) == 2 * sizeof(double) && sizeof(Disk) == 3 * sizeof(double));
  array(data, count, 2, "points");
  return {reinterpret_cast<const Point2*>(data), count};
}
inline std::span<const Disk> disks_of(const double* data, size_t count) {
  array(data, count, 3, "disks");
  return {reinterpret_cast<const Disk*>(data), count};
}

inline void give(const std::vector<uint32_t>& indices, lumicut_indices* out, const char* name) {
  required(out, name);
  if (const int code = lumicut_indices_create(indices.data(), indices.size(), out); code != LUMICUT_GEOMETRY_OK)
    throw std::bad_alloc();
}

}  // namespace lumicut::c_api
