#include "render/glint_guide.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "geometry/places.h"

namespace lumicut {

namespace {
constexpr size_t kNeighbour = 3;
}

GlintGuide::GlintGuide(std::span<const Glint> glints, const Progress* progress)
    : glints_(glints), tree_(rows_of(glints, [](const Glint& g) { return g.position; }), 3, progress) {}

GlintGuide::Directions GlintGuide::at(const Vec3f& position, const Vec3f& normal,
                                      BallQueryTree::Scratch& scratch) const {
  Directions d;
  std::array<uint32_t, kNearest> index;
  std::array<double, kNearest> dist2;
  const size_t found = tree_.nearest(row_of(position).data(), kNearest, index.data(), dist2.data(), scratch);
  if (found < 2) return d;
  const double radius2 = 1.0001 * dist2[found - 1];  // the farthest counts a little too
  float sum = 0.0f;
  for (size_t i = 0; i < found; ++i) {
    const Glint& g = glints_[index[i]];
    const Vec3f way = g.from - position;
    const float distance2 = length2(way);
    if (!(distance2 > static_cast<float>(radius2)) || !(dot(way, normal) > 0.0f)) continue;
    const float weight = g.power * static_cast<float>(1.0 - dist2[i] / radius2);
    if (!(weight > 0.0f)) continue;
    d.directions_[d.count_] = way * (1.0f / std::sqrt(distance2)), d.weights_[d.count_] = weight;
    sum += weight;
    ++d.count_;
  }
  if (d.count_ < 2 || !(sum > 0.0f)) return Directions{};
  for (size_t i = 0; i < d.count_; ++i) d.weights_[i] /= sum;
  // Each as wide as its third nearest neighbour is far: several sources stay apart.
  constexpr float kLeast2 = 4e-4f, kMost2 = 0.1f;  // squares of about 1 and 18 degrees
  for (size_t i = 0; i < d.count_; ++i) {
    std::array<float, kNeighbour> nearest;
    nearest.fill(8.0f);
    for (size_t k = 0; k < d.count_; ++k) {
      if (k == i) continue;
      float chord2 = length2(d.directions_[i] - d.directions_[k]);
      for (float& n : nearest)
        if (chord2 < n) std::swap(n, chord2);
    }
    d.concentrations_[i] = 1.0f / std::clamp(0.5f * nearest[std::min(kNeighbour, d.count_ - 1) - 1], kLeast2, kMost2);
  }
  return d;
}

Vec3f GlintGuide::Directions::sample(float choice, float u, float v) const {
  size_t i = 0;
  while (i + 1 < count_ && choice >= weights_[i]) choice -= weights_[i++];
  // Fisher's distribution on the sphere.
  const float k = concentrations_[i], least = std::exp(-2.0f * k);
  const float cosine = std::clamp(1.0f + std::log(u + (1.0f - u) * least) / k, -1.0f, 1.0f);
  const float sine = std::sqrt(std::max(0.0f, 1.0f - cosine * cosine)), turn = 2.0f * std::numbers::pi_v<float> * v;
  return Frame(directions_[i]).to_world({sine * std::cos(turn), sine * std::sin(turn), cosine});
}

float GlintGuide::Directions::pdf(const Vec3f& direction) const {
  float sum = 0.0f;
  for (size_t i = 0; i < count_; ++i) {
    const float k = concentrations_[i];
    sum += weights_[i] * k * std::exp(k * (dot(directions_[i], direction) - 1.0f)) / (1.0f - std::exp(-2.0f * k));
  }
  return sum / (2.0f * std::numbers::pi_v<float>);
}

}  // namespace lumicut
