// Places as trees of nearest neighbours take them: rows of three doubles.
#pragma once

#include <array>
#include <vector>

#include "core/vec.h"

namespace lumicut {

inline std::array<double, 3> row_of(const Vec3f& place) {
  return {static_cast<double>(place.x), static_cast<double>(place.y), static_cast<double>(place.z)};
}

// `place_of`: an item's.
template <class Items, class PlaceOf>
std::vector<double> rows_of(const Items& items, const PlaceOf& place_of) {
  std::vector<double> rows;
  rows.reserve(3 * items.size());
  for (const auto& item : items)
    for (const double x : row_of(place_of(item))) rows.push_back(x);
  return rows;
}

}  // namespace lumicut
