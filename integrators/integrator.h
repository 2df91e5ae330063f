// What every many-lights method offers, and how it is found. A new integrator is one file and one line in
// integrator_list.inc: the build, the registry, the command's help and the panels of hosts all read that line.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/progress.h"
#include "core/stats.h"
#include "integrators/params.h"
#include "lights/vpl.h"
#include "scene/scene.h"

namespace lumicut {

// Counts a point, for heat maps.
struct PointCounts {
  uint32_t clusters = 0, rays = 0, bounds = 0;
};

// All that `shade` needs beside the points.
struct ShadeContext {
  Progress& progress;
  Stats& stats;
};

class Integrator {
 public:
  virtual ~Integrator() = default;

  // Builds what does not depend on the points. Scene and lights outlive the integrator's use.
  virtual void prepare(const Scene& scene, const VplSet& vpls, const Params& params, ShadeContext context) = 0;

  // Reflected radiance of points.size() points; `counts` is empty or as long. Concurrent; a pure function of seed and
  // input. Points of one pixel lie together and whole in one call.
  virtual void shade(const ShadePoints& points, std::span<Rgb> radiance, std::span<PointCounts> counts,
                     ShadeContext context) const = 0;

  // Points that one call of `shade` works best on. Frames come in batches of about this many: small for methods that
  // treat points alone, large for those that cluster them.
  virtual size_t batch_size() const { return 4096; }

  // Whether lights or paths are drawn for each point anew, so that neighbours' errors are independent: denoising averages
  // them out.
  virtual bool chooses_at_each_point() const { return false; }

  // What `prepare` made, as bytes that `load_state` takes back in its place: the same scene, lights and parameters give
  // the same radiance. Bytes may come from anywhere: what does not fit throws Error(invalid_argument). By default both
  // throw Error(unsupported).
  virtual std::vector<uint8_t> save_state() const;
  virtual void load_state(const Scene& scene, const VplSet& vpls, const Params& params, std::span<const uint8_t> bytes,
                          ShadeContext context);
};

// Where a method takes light from: virtual lights, or the scene's emitters themselves.
enum class LightSource { virtual_lights, emitters };

struct IntegratorEntry {
  const char *id, *label, *description, *source;
  ParamTable (*params)();  // its own, and its struct; null: it has none
  std::unique_ptr<Integrator> (*create)();
  LightSource light_source = LightSource::virtual_lights;
};

// Of all integrators, in the order of integrator_list.inc.
std::span<const IntegratorEntry> integrators();
const IntegratorEntry* find_integrator(const std::string& id);

// vpls, seed, max_depth, direct_share, clamp_relative, clamp_distance and such.
ParamTable common_params();
// What the integrator accepts: common_params() and its own. Stays for as long as the process.
const ParamTable& all_params(const IntegratorEntry& entry);
// Those of all_params() that have an effect on it: what hosts show.
std::vector<const Param*> effective_params(const IntegratorEntry& entry);

}  // namespace lumicut
