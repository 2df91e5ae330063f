// Exact means of a filtered texture over triangles: the power of textured emitters, one by one.
// By Green's theorem the integral over a triangle is that of the antiderivative along u around its edges; within a cell
// of the bilinear interpolant that is a cubic, which two Gauss points integrate exactly. Costs the texels that the
// edges cross, not those inside. Departs from exact where a texture has more than 2^24 texels (boxes of texels are
// averaged first) and where a triangle's edges cross more than 2^20 texels (the texture's mean stands for it).
#pragma once

#include <vector>

#include "core/progress.h"
#include "scene/texture.h"

namespace lumicut {

class TextureIntegral {
 public:
  // Of the luminance of factor · texture.
  TextureIntegral(const Texture& texture, const Rgb& factor, const Progress* progress = nullptr);
  // Mean over the triangle of texture coordinates, not below 0; over a segment or point where it is flat.
  double mean(Vec2f a, Vec2f b, Vec2f c) const;

 private:
  // Rows and columns of samples, extended by repeating or by clamping.
  double row_sum(int64_t row, int64_t column) const;  // of the interpolant from column 0 to `column`
  double value(int64_t row, int64_t column) const;
  int64_t wrapped_row(int64_t row) const;
  double antiderivative(double x, double y, int64_t column, int64_t row, int64_t first_column) const;
  double at(double x, double y) const;
  double edge(const double (&a)[2], const double (&b)[2], int64_t first_column) const;

  int64_t width_, height_;
  bool clamp_, nearest_;
  std::vector<float> values_;
  std::vector<double> sums_;  // width_ + 1 a row
  double average_ = 0;
};

}  // namespace lumicut
