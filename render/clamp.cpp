#include "render/clamp.h"

#include <cmath>
#include <numbers>

#include "core/parallel.h"

namespace lumicut {

Clamp::Clamp(const VplSet& set, const CommonParams& params, const Scene& scene, const Progress& progress)
    : of_ten_thousand_(params.clamp_lights), distance_(clamp_distance(params, scene)) {
  on_paths_ = lights_among(set.lights.size() - set.direct), of_emitters_ = lights_on_emitters(set.extended);
  exact_points_ = !(distance_ > 0.0f) || params.compensate;
  const std::span<const Vpl> indirect = std::span(set.lights).subspan(set.direct);
  const bool points = std::any_of(indirect.begin(), indirect.end(), [](const Vpl& v) {
    return v.kind != VplKind::sphere && v.kind != VplKind::directional;
  });
  if (distance_ > 0.0f || !(on_paths_ > 0.0) || !points) return;
  constexpr float kLonely = 0.1f;  // of the typical radius
  spacing_ = std::make_unique<const LightSpacing>(indirect, kLonely * scene.extent().radius(), &progress);
}

double Clamp::lights_among(uint64_t count) const {
  return distance_ > 0.0f ? 0.0 : of_ten_thousand_ * std::pow(static_cast<double>(count) / 1e4, 2.0 / 3.0);
}

double Clamp::lights_on_emitters(uint64_t count) const {
  return distance_ > 0.0f ? 0.0 : std::max(of_ten_thousand_, lights_among(count));
}

// A disk of the spacing's radius holds kNeighbour of them.
float Clamp::from_spacing2(float spacing) const {
  return static_cast<float>(static_cast<double>(spacing) * static_cast<double>(spacing) * on_paths_ /
                            static_cast<double>(LightSpacing::kNeighbour));
}

void Clamp::set_on(VplSet& set, const Progress& progress) const {
  // More than nearly any light path leaves; of few lights an eighth, and of a host's own nothing is known.
  constexpr size_t kOnePath = 32;
  const size_t of_paths = set.lights.size() - set.direct;
  const size_t beside = set.light_paths > 0 ? std::min(kOnePath, of_paths / 16) : 0;
  parallel_chunks(set.lights.size(), 1024, [&](size_t begin, size_t end) {
    progress.check();
    BallQueryTree::Scratch scratch;
    for (size_t i = begin; i < end; ++i) {
      Vpl& v = set.lights[i];
      v.clamp2 = 0.0f;
      if (v.kind == VplKind::directional || v.kind == VplKind::sphere) continue;
      const bool point = i < set.direct && !(v.cell > 0.0f);
      if (point && exact_points_) continue;
      if (distance_ > 0.0f)
        v.clamp2 = distance_ * distance_;
      else if (i < set.direct)
        v.clamp2 = static_cast<float>(of_emitters_ * static_cast<double>(v.cell) * std::numbers::inv_pi);
      else if (spacing_ != nullptr)
        v.clamp2 = from_spacing2(spacing_->of_light(i - set.direct, beside, scratch));
    }
  });
}

float Clamp::at2(const Vec3f& position, BallQueryTree::Scratch& scratch) const {
  if (distance_ > 0.0f) return distance_ * distance_;
  return spacing_ != nullptr ? from_spacing2(spacing_->at(position, scratch)) : 0.0f;
}

}  // namespace lumicut
