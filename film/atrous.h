// One pass of a 3x3 binomial kernel with holes, weighted by how alike two pixels' surfaces are. Passes with steps 1, 2, 4,
// ... make a wide kernel that stops at edges. [Dammertz et al. 2010]
// Weights depend on the surfaces alone, never on what is filtered: the filter is linear, keeps what light there is, and
// does to one half of the passes what it does to the other.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace lumicut {

// Planes of floats with a margin on both sides of each row, wider than any step and than a vector.
class PaddedPlanes {
 public:
  static constexpr size_t kMargin = 64 + 16;

  PaddedPlanes(size_t count, size_t width, size_t height, float margin = 0.0f)
      : width_(width),
        height_(height),
        stride_((width + 2 * kMargin + 15) / 16 * 16),
        values_(count * height * stride_, margin) {}
  size_t width() const { return width_; }
  size_t height() const { return height_; }
  float* row(size_t plane, size_t y) { return values_.data() + (plane * height_ + y) * stride_ + kMargin; }
  const float* row(size_t plane, size_t y) const { return values_.data() + (plane * height_ + y) * stride_ + kMargin; }

 private:
  size_t width_, height_, stride_;
  std::vector<float> values_;
};

// The planes of a guide. Of differences of the features the squares add up to how unlike two pixels are: 1 is a standard
// deviation of a Gaussian. `inverse_depth` is linear over a plane in perspective, and is compared with where the plane
// through the pixel goes. All of it is divided by `loosened`, at least 1.
struct Guide {
  static constexpr size_t kFeatures = 6, kInverseDepth = 6, kAlongX = 7, kAlongY = 8, kLoosened = 9, kPlanes = 10;
  static constexpr float kFar = 1e4f;  // of features in the margin: like nothing
};

// How many planes are filtered at once: all, or the first few, where the looser of two pixels decides how alike they are:
// what stands on an edge goes to both sides.
inline constexpr size_t kFiltered = 8, kFirstFiltered = 3;

// Rows [begin, end): of `in` into `out`.
void atrous_rows(const PaddedPlanes& guide, const PaddedPlanes& in, size_t step, size_t begin, size_t end,
                 PaddedPlanes& out);
void atrous_first_rows(const PaddedPlanes& guide, const PaddedPlanes& in, size_t step, size_t begin, size_t end,
                       PaddedPlanes& out);
// Of the eight nearest pixels, the mean weight: 1 inside a surface, near 0 where a pixel is like none of them.
void support_rows(const PaddedPlanes& guide, size_t begin, size_t end, PaddedPlanes& out);

}  // namespace lumicut
