#include "lights/texture_integral.h"

#include <algorithm>
#include <cmath>

namespace lumicut {

namespace {
constexpr double kMostTexels = 1 << 24;
constexpr double kMostCrossings = 1 << 20;
}  // namespace

TextureIntegral::TextureIntegral(const Texture& texture, const Rgb& factor, const Progress* progress)
    : clamp_(texture.clamped()), nearest_(texture.nearest()) {
  uint32_t box = 1;
  while (double{1} * texture.width() * texture.height() / (double{1} * box * box) > kMostTexels) ++box;
  width_ = (texture.width() + box - 1) / box, height_ = (texture.height() + box - 1) / box;
  values_.assign(static_cast<size_t>(width_ * height_), 0.0f);
  for (int64_t y = 0; y < height_; ++y) {
    check_now_and_then(progress, 0);
    for (int64_t x = 0; x < width_; ++x) {
      const auto x0 = static_cast<uint32_t>(x * box), y0 = static_cast<uint32_t>(y * box);
      const uint32_t x1 = std::min(texture.width(), x0 + box), y1 = std::min(texture.height(), y0 + box);
      double sum = 0;
      for (uint32_t j = y0; j < y1; ++j)
        for (uint32_t i = x0; i < x1; ++i) sum += luminance(factor * texture.texel(i, j));
      values_[static_cast<size_t>(y * width_ + x)] = static_cast<float>(sum / ((x1 - x0) * double{1} * (y1 - y0)));
    }
  }
  sums_.resize(static_cast<size_t>((width_ + 1) * height_));
  for (int64_t y = 0; y < height_; ++y) {
    double* row = &sums_[static_cast<size_t>(y * (width_ + 1))];
    const float* v = &values_[static_cast<size_t>(y * width_)];
    row[0] = 0;
    for (int64_t x = 0; x < width_; ++x) {
      const double next = clamp_ ? v[std::min(x + 1, width_ - 1)] : v[(x + 1) % width_];
      row[x + 1] = row[x] + (nearest_ ? v[x] : 0.5 * (v[x] + next));
      average_ += v[x];
    }
  }
  average_ /= static_cast<double>(width_ * height_);
}

int64_t TextureIntegral::wrapped_row(int64_t row) const {
  if (clamp_) return std::clamp<int64_t>(row, 0, height_ - 1);
  return ((row % height_) + height_) % height_;
}

double TextureIntegral::value(int64_t row, int64_t column) const {
  const int64_t x = clamp_ ? std::clamp<int64_t>(column, 0, width_ - 1) : ((column % width_) + width_) % width_;
  return values_[static_cast<size_t>(wrapped_row(row) * width_ + x)];
}

double TextureIntegral::row_sum(int64_t row, int64_t column) const {
  const int64_t r = wrapped_row(row);
  const double* sums = &sums_[static_cast<size_t>(r * (width_ + 1))];
  if (clamp_) {
    const int64_t x = std::clamp<int64_t>(column, 0, nearest_ ? width_ : width_ - 1);
    return sums[x] + static_cast<double>(column - x) * value(r, x);
  }
  const int64_t x = ((column % width_) + width_) % width_;
  return sums[x] + static_cast<double>((column - x) / width_) * sums[width_];
}

// From `first_column` to x along y, which lie in the cell of that column and row.
double TextureIntegral::antiderivative(double x, double y, int64_t column, int64_t row, int64_t first_column) const {
  const double t = x - static_cast<double>(column), s = y - static_cast<double>(row);
  const double top = row_sum(row, column) - row_sum(row, first_column);
  if (nearest_) return top + t * value(row, column);
  const double bottom = row_sum(row + 1, column) - row_sum(row + 1, first_column);
  const double left = value(row, column) * (1 - s) + value(row + 1, column) * s;
  const double right = value(row, column + 1) * (1 - s) + value(row + 1, column + 1) * s;
  return top * (1 - s) + bottom * s + left * (t - 0.5 * t * t) + right * (0.5 * t * t);
}

double TextureIntegral::at(double x, double y) const {
  const auto column = static_cast<int64_t>(std::floor(x)), row = static_cast<int64_t>(std::floor(y));
  if (nearest_) return value(row, column);
  const double t = x - static_cast<double>(column), s = y - static_cast<double>(row);
  return (value(row, column) * (1 - t) + value(row, column + 1) * t) * (1 - s) +
         (value(row + 1, column) * (1 - t) + value(row + 1, column + 1) * t) * s;
}

// ∫ antiderivative dy along the edge, cell by cell.
double TextureIntegral::edge(const double (&a)[2], const double (&b)[2], int64_t first_column) const {
  const double d[2] = {b[0] - a[0], b[1] - a[1]};
  if (d[1] == 0) return 0;
  double sum = 0, from = 0;
  // The next lines of the grid that the edge crosses, as parameters along it.
  double line[2], step[2], next[2];
  for (int k = 0; k < 2; ++k) {
    step[k] = d[k] > 0 ? 1 : -1;
    line[k] = d[k] > 0 ? std::floor(a[k]) + 1 : std::ceil(a[k]) - 1;
    next[k] = d[k] == 0 ? 2 : (line[k] - a[k]) / d[k];
  }
  constexpr double kGauss = 0.28867513459481288;  // ½/√3
  while (from < 1) {
    const double to = std::min(1.0, std::min(next[0], next[1]));
    if (to > from) {
      const double middle = 0.5 * (from + to), half = to - from;
      const auto column = static_cast<int64_t>(std::floor(a[0] + d[0] * middle));
      const auto row = static_cast<int64_t>(std::floor(a[1] + d[1] * middle));
      for (const double g : {-kGauss, kGauss}) {
        const double p = middle + g * half;
        sum += 0.5 * half * antiderivative(a[0] + d[0] * p, a[1] + d[1] * p, column, row, first_column);
      }
    }
    from = to;
    for (int k = 0; k < 2; ++k)
      if (next[k] <= to) line[k] += step[k], next[k] = (line[k] - a[k]) / d[k];
  }
  return sum * d[1];
}

double TextureIntegral::mean(Vec2f a, Vec2f b, Vec2f c) const {
  double p[3][2];
  const Vec2f uv[3] = {a, b, c};
  const double shift = nearest_ ? 0.0 : 0.5;
  for (int k = 0; k < 3; ++k)
    p[k][0] = uv[k].x * static_cast<double>(width_) - shift,
    p[k][1] = (1.0 - uv[k].y) * static_cast<double>(height_) - shift;
  double crossings = 0, low = p[0][0];
  for (int k = 0; k < 3; ++k) {
    const auto& q = p[(k + 1) % 3];
    crossings += std::abs(q[0] - p[k][0]) + std::abs(q[1] - p[k][1]);
    low = std::min(low, p[k][0]);
  }
  if (!(crossings < kMostCrossings)) return average_;
  const double area2 = (p[1][0] - p[0][0]) * (p[2][1] - p[0][1]) - (p[2][0] - p[0][0]) * (p[1][1] - p[0][1]);
  if (std::abs(area2) < 1e-9 * (1 + crossings * crossings)) {
    // A segment or a point: means along the edges, and never 0 where the segment might meet light between them.
    const int samples = 2 + static_cast<int>(4 * crossings);
    double sum = 0;
    for (int k = 0; k < 3; ++k)
      for (int i = 0; i < samples; ++i) {
        const double t = (i + 0.5) / samples;
        const auto& q = p[(k + 1) % 3];
        sum += at(p[k][0] + (q[0] - p[k][0]) * t, p[k][1] + (q[1] - p[k][1]) * t);
      }
    return crossings > 0 ? std::max(sum / (3 * samples), 1e-3 * average_) : sum / (3 * samples);
  }
  const auto first_column = static_cast<int64_t>(std::floor(low));
  double sum = 0;
  for (int k = 0; k < 3; ++k) sum += edge(p[k], p[(k + 1) % 3], first_column);
  // Green: ∮ G dy is the integral, counter-clockwise; the other way round both change sign.
  return std::max(0.0, sum / (0.5 * area2));
}

}  // namespace lumicut
