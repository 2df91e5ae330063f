#include "render/limited_lights.h"

#include <algorithm>
#include <map>

#include "bsdf/point_bsdf.h"
#include "lights/light_reach.h"

namespace lumicut {

namespace {

class LimitedLights final : public Integrator {
 public:
  explicit LimitedLights(const IntegratorEntry& entry) : entry_(entry), plain_(entry.create()) {}

  void prepare(const Scene& scene, const VplSet& vpls, const Params& params, ShadeContext context) override {
    parts_.clear();
    std::map<std::pair<uint32_t, uint32_t>, Part> parts;
    for (size_t i = 0; i < vpls.lights.size(); ++i) {
      const Vpl& v = vpls.lights[i];
      Part& part = parts[{v.seen_by, v.receivers}];
      part.lights.lights.push_back(v);
      if (i < vpls.direct) ++part.lights.direct;
    }
    for (auto& [reach, part] : parts) {
      part.seen_by = reach.first, part.receivers = reach.second;
      part.lights.profiles = vpls.profiles;
      // What is known of all lights' density holds for each kind of them.
      part.lights.light_paths = vpls.light_paths, part.lights.extended = vpls.extended;
      parts_.push_back(std::move(part));
    }
    for (Part& part : parts_) {  // their places are fixed now
      part.method = entry_.create();
      part.method->prepare(scene, part.lights, params, context);
    }
  }

  void shade(const ShadePoints& points, std::span<Rgb> radiance, std::span<PointCounts> counts,
             ShadeContext context) const override {
    std::fill(radiance.begin(), radiance.end(), Rgb{});
    std::fill(counts.begin(), counts.end(), PointCounts{});
    for (const Part& part : parts_) {
      context.progress.check();
      ShadePoints lit;
      std::vector<uint32_t> number;
      for (size_t i = 0; i < points.size(); ++i) {
        SurfacePoint point = points.get(i);
        limit(point, part.seen_by, part.receivers);
        if (PointBsdf(point).black()) continue;
        lit.push(point), number.push_back(static_cast<uint32_t>(i));
      }
      if (number.empty()) continue;
      lit.finish();
      std::vector<Rgb> light(lit.size());
      std::vector<PointCounts> work(counts.empty() ? 0 : lit.size());
      part.method->shade(lit, light, work, context);
      for (size_t k = 0; k < number.size(); ++k) radiance[number[k]] += light[k];
      for (size_t k = 0; k < work.size(); ++k) {
        PointCounts& sum = counts[number[k]];
        sum.clusters += work[k].clusters, sum.rays += work[k].rays, sum.bounds += work[k].bounds;
      }
    }
  }

  size_t batch_size() const override { return plain_->batch_size(); }
  bool chooses_at_each_point() const override { return plain_->chooses_at_each_point(); }

 private:
  struct Part {
    uint32_t seen_by = 0, receivers = 0;
    VplSet lights;
    std::unique_ptr<Integrator> method;
  };
  const IntegratorEntry& entry_;
  const std::unique_ptr<Integrator> plain_;  // for what does not depend on the lights
  std::vector<Part> parts_;
};

}  // namespace

std::unique_ptr<Integrator> create_method(const IntegratorEntry& entry, const VplSet& lights) {
  if (std::all_of(lights.lights.begin(), lights.lights.end(), lights_all)) return entry.create();
  return std::make_unique<LimitedLights>(entry);
}

}  // namespace lumicut
