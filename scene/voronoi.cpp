#include "scene/voronoi.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace lumicut {

namespace {

Vec4f operator+(const Vec4f& a, const Vec4f& b) { return {a.x + b.x, a.y + b.y, a.z + b.z, a.w + b.w}; }
Vec4f operator-(const Vec4f& a, const Vec4f& b) { return {a.x - b.x, a.y - b.y, a.z - b.z, a.w - b.w}; }
Vec4f operator*(const Vec4f& a, float s) { return {a.x * s, a.y * s, a.z * s, a.w * s}; }
float dot(const Vec4f& a, const Vec4f& b) { return a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w; }

// The lattice around a place.
class Lattice {
 public:
  Lattice(const Vec4f& p, const VoronoiOptions& o) : options_(o) {
    const auto split = [](float x, float& cell, float& local) { cell = std::floor(x), local = x - cell; };
    split(p.x, cell_.x, local_.x);
    if (o.dimensions > 1) split(p.y, cell_.y, local_.y);
    if (o.dimensions > 2) split(p.z, cell_.z, local_.z);
    if (o.dimensions > 3) split(p.w, cell_.w, local_.w);
  }

  const Vec4f& cell() const { return cell_; }
  const Vec4f& local() const { return local_; }
  // Of the point in the lattice cell at `offset`, from this one's corner.
  Vec4f point(const Vec4f& offset) const {
    return offset + hash_place(cell_ + offset, options_.dimensions) * options_.randomness;
  }
  // What lies in its dimensions.
  Vec4f within(const Vec4f& p) const {
    const int n = options_.dimensions;
    return {p.x, n > 1 ? p.y : 0.0f, n > 2 ? p.z : 0.0f, n > 3 ? p.w : 0.0f};
  }
  Rgb color(const Vec4f& offset) const { return hash_color(cell_ + offset, options_.dimensions); }

  // All offsets within `reach` cells, the first coordinate fastest.
  template <typename Visit>
  void around(int reach, Visit&& visit) const {
    const auto span = [&](int dimension) { return options_.dimensions >= dimension ? reach : 0; };
    for (int l = -span(4); l <= span(4); ++l)
      for (int k = -span(3); k <= span(3); ++k)
        for (int j = -span(2); j <= span(2); ++j)
          for (int i = -reach; i <= reach; ++i)
            visit(Vec4f{static_cast<float>(i), static_cast<float>(j), static_cast<float>(k), static_cast<float>(l)});
  }

  float distance(const Vec4f& a, const Vec4f& b) const {
    const Vec4f d = a - b;
    const float x = std::abs(d.x), y = std::abs(d.y), z = std::abs(d.z), w = std::abs(d.w);
    if (options_.dimensions == 1) return x;
    switch (options_.metric) {
      case VoronoiMetric::manhattan:
        return x + y + z + w;
      case VoronoiMetric::chebyshev:
        return std::max(std::max(x, y), std::max(z, w));
      case VoronoiMetric::minkowski: {
        const float e = options_.exponent;
        float sum = std::pow(x, e) + std::pow(y, e);
        if (options_.dimensions > 2) sum += std::pow(z, e);
        if (options_.dimensions > 3) sum += std::pow(w, e);
        return std::pow(sum, 1.0f / e);
      }
      default:
        return std::sqrt(dot(d, d));
    }
  }

 private:
  const VoronoiOptions& options_;
  Vec4f cell_{}, local_{};
};

constexpr float kFar = 8.0f;

VoronoiCell nearest(const Lattice& lattice, bool second) {
  float first = kFar, next = kFar;
  Vec4f offset, place, offset2, place2;
  lattice.around(1, [&](const Vec4f& o) {
    const Vec4f point = lattice.point(o);
    const float d = lattice.distance(point, lattice.local());
    if (d < first) {
      next = first, offset2 = offset, place2 = place;
      first = d, offset = o, place = point;
    } else if (d < next) {
      next = d, offset2 = o, place2 = point;
    }
  });
  if (second) return {next, lattice.color(offset2), place2 + lattice.cell()};
  return {first, lattice.color(offset), place + lattice.cell()};
}

VoronoiCell smooth(const Lattice& lattice, float smoothness) {
  if (!(smoothness > 0.0f)) return nearest(lattice, false);
  VoronoiCell sum{kFar, {}, {}};
  lattice.around(2, [&](const Vec4f& o) {
    const Vec4f point = lattice.point(o);
    const float d = lattice.distance(point, lattice.local());
    const float t = std::clamp(0.5f + 0.5f * (sum.distance - d) / smoothness, 0.0f, 1.0f);
    const float h = t * t * (3.0f - 2.0f * t);
    float correction = smoothness * h * (1.0f - h);
    sum.distance += (d - sum.distance) * h - correction;
    correction /= 1.0f + 3.0f * smoothness;
    const Rgb color = lattice.color(o);
    sum.color = sum.color + (color - sum.color) * h - Rgb{correction, correction, correction};
    sum.position = sum.position + (point - sum.position) * h - Vec4f{correction, correction, correction, correction};
  });
  sum.position = lattice.within(sum.position) + lattice.cell();
  return sum;
}

float edge(const Lattice& lattice, int dimensions) {
  if (dimensions == 1) {
    const auto point = [&](float o) { return lattice.point({o}).x; };
    const float middle = point(0.0f), at = lattice.local().x;
    return std::min(std::abs(0.5f * (point(-1.0f) + middle) - at), std::abs(0.5f * (point(1.0f) + middle) - at));
  }
  Vec4f closest;
  float least = kFar;
  lattice.around(1, [&](const Vec4f& o) {
    const Vec4f to = lattice.point(o) - lattice.local();
    if (const float d = dot(to, to); d < least) least = d, closest = to;
  });
  float distance = kFar;
  lattice.around(1, [&](const Vec4f& o) {
    const Vec4f to = lattice.point(o) - lattice.local(), across = to - closest;
    const float d2 = dot(across, across);
    if (d2 > 1e-4f) distance = std::min(distance, 0.5f * dot(closest + to, across) / std::sqrt(d2));
  });
  return distance;
}

float radius(const Lattice& lattice) {
  Vec4f offset, place;
  float least = kFar;
  lattice.around(1, [&](const Vec4f& o) {
    const Vec4f point = lattice.point(o);
    if (const float d = lattice.distance(point, lattice.local()); d < least) least = d, offset = o, place = point;
  });
  least = kFar;
  lattice.around(1, [&](const Vec4f& o) {
    if (dot(o, o) == 0.0f) return;
    least = std::min(least, lattice.distance(place, lattice.point(o + offset)));
  });
  return 0.5f * least;
}

}  // namespace

VoronoiCell voronoi(const Vec4f& p, const VoronoiOptions& o) {
  const Lattice lattice(p, o);
  switch (o.feature) {
    case VoronoiFeature::second:
      return nearest(lattice, true);
    case VoronoiFeature::smooth:
      return smooth(lattice, o.smoothness);
    case VoronoiFeature::edge:
      return {edge(lattice, o.dimensions), {}, {}};
    case VoronoiFeature::radius:
      return {radius(lattice), {}, {}};
    default:
      return nearest(lattice, false);
  }
}

}  // namespace lumicut
