// What the passes of a pixel tell of its noise, beside their mean: what denoising goes by. [film/denoise.h]
#pragma once

#include <cstdint>

#include "core/vec.h"

namespace lumicut {

// Of each half of the passes, the first, third ... and the second, fourth ..., so many of the brightest are remembered.
inline constexpr int kBrightest = 2;

struct ResidualSums {
  Rgb odd{};                          // sum of the channel `residual` over the first, third ... pass
  float mean = 0.0f, squares = 0.0f;  // luminance of what is not residual; squares of distances from it [Welford 1962]
  Rgb brightest[2][kBrightest] = {};  // of the residual, in either half, the brightest first

  // Pass number `passes`, counted from 1.
  void add(const Rgb& residual, const Rgb& radiance, uint64_t passes) {
    const bool is_odd = passes % 2 == 1;
    if (is_odd) odd += residual;
    const float rest = luminance(radiance - residual), away = rest - mean;
    mean += away / static_cast<float>(passes);
    squares += away * (rest - mean);
    Rgb next = residual;
    for (Rgb& kept : brightest[is_odd ? 0 : 1])
      if (luminance(next) > luminance(kept)) std::swap(next, kept);
  }
};

}  // namespace lumicut
