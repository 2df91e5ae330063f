// What every many-lights method offers, and how it is found. A new integrator is one file and one line in
// integrator_list.inc: the build, the registry, the command's help and the panels of hosts all read that line.
#pragma once

#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/progress.h"
#include "core/stats.h"
#include "lights/vpl.h"
#include "scene/scene.h"

namespace lumicut {

enum class ParamType : uint32_t { real = 0, integer = 1, boolean = 2, choice = 3 };

struct ParamInfo {
  const char *id, *label, *description, *unit;
  ParamType type;
  const char* default_text;
  double minimum = 0, maximum = 0;  // of numbers
  const char* choices = "";         // "a|b|c"
  bool of_virtual_lights = false;   // without effect on a method that uses none
};

// Values of one integrator's parameters, checked against its table.
class Params {
 public:
  explicit Params(std::vector<ParamInfo> table);
  std::span<const ParamInfo> table() const { return table_; }
  // Throws Error naming parameter, value and what is allowed; then nothing has changed.
  void set(const std::string& name, const std::string& value);
  // nullptr: no such parameter.
  const std::string* text(const std::string& name) const;
  double real(const std::string& name) const;
  int64_t integer(const std::string& name) const { return static_cast<int64_t>(real(name)); }
  bool boolean(const std::string& name) const { return real(name) != 0; }
  const std::string& choice(const std::string& name) const;
  // nullptr: no such parameter.
  const ParamInfo* find(const std::string& name) const;

 private:
  std::vector<ParamInfo> table_;
  std::map<std::string, std::string> values_;
};

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
  std::vector<ParamInfo> (*params)();  // its own; common_params() come first
  std::unique_ptr<Integrator> (*create)();
  LightSource light_source = LightSource::virtual_lights;
};

// Of all integrators, in the order of integrator_list.inc.
std::span<const IntegratorEntry> integrators();
const IntegratorEntry* find_integrator(const std::string& id);
// What the integrator accepts: common_params() and its own.
std::vector<ParamInfo> all_params(const IntegratorEntry& entry);
// Those of all_params() that have an effect on it: what hosts show.
std::vector<ParamInfo> effective_params(const IntegratorEntry& entry);

// vpls, seed, max_depth, direct_share, clamp_relative, clamp_distance and such: what every method accepts, so that a
// host may set them whatever the method.
std::vector<ParamInfo> common_params();

// Distance below which no light comes nearer, in scene units: clamp_distance, or clamp_relative of the scene's radius.
float clamp_distance(const Params& params, const Scene& scene);

// sphere_scale where virtual lights are spheres, 0 where they are points.
float sphere_scale(const Params& params);

}  // namespace lumicut
