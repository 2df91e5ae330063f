// A plane of means over blocks of 4x4 pixels, blurred, and looked up between its centres: what varies slowly, or is wanted
// only in the mean.
#pragma once

#include <algorithm>
#include <vector>

#include "core/parallel.h"
#include "core/progress.h"

namespace lumicut {

class CoarsePlane {
 public:
  static constexpr size_t kBlock = 4;

  CoarsePlane(size_t width, size_t height)
      : full_width_(width),
        full_height_(height),
        width_((width + kBlock - 1) / kBlock),
        height_((height + kBlock - 1) / kBlock),
        values_(width_ * height_),
        other_(width_ * height_) {}

  // value(x, y) of each pixel. Throws Error(cancelled).
  template <typename Fn>
  void fill(const Progress& progress, Fn&& value) {
    parallel_chunks(height_, 4, [&](size_t begin, size_t end) {
      if (progress.cancelled()) return;
      for (size_t row = begin; row < end; ++row)
        for (size_t column = 0; column < width_; ++column) {
          const size_t x1 = std::min(full_width_, (column + 1) * kBlock),
                       y1 = std::min(full_height_, (row + 1) * kBlock);
          float sum = 0.0f;
          size_t count = 0;
          for (size_t y = row * kBlock; y < y1; ++y)
            for (size_t x = column * kBlock; x < x1; ++x, ++count) sum += value(x, y);
          values_[row * width_ + column] = sum / static_cast<float>(count);
        }
    });
    progress.check();
  }
  // Twice a box of 2·radius + 1 blocks; at the border of what there is of it.
  void blur(size_t radius);
  float at(size_t x, size_t y) const;

 private:
  size_t full_width_, full_height_, width_, height_;
  std::vector<float> values_, other_;
};

}  // namespace lumicut
