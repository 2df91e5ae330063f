// The transfer function of sRGB. [IEC 61966-2-1]
#pragma once

#include <cmath>

namespace lumicut::io {

template <typename T>
T linear_of_srgb(T s) {
  return s <= static_cast<T>(0.04045)
             ? s / static_cast<T>(12.92)
             : std::pow((s + static_cast<T>(0.055)) / static_cast<T>(1.055), static_cast<T>(2.4));
}

}  // namespace lumicut::io
