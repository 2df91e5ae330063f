// What stands behind the handles of lumicut.h.
#pragma once

#include <chrono>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "accel/accel.h"
#include "core/log.h"
#include "core/parallel.h"
#include "core/progress.h"
#include "core/stats.h"
#include "integrators/integrator.h"
#include "plugin/boundary.h"
#include "plugin/convert.h"
#include "render/preparation.h"
#include "scene/scene.h"

namespace lumicut {

class Bvh;

// Long work of one object, seen from other threads: status and cancel.
class Work {
 public:
  // A new run, with a Progress of its own: a cancel that came before it is forgotten.
  std::shared_ptr<Progress> begin();
  void end(int32_t state);
  // For work that many threads do at once (shade): one Progress, replaced when it is cancelled.
  std::shared_ptr<Progress> share();
  void cancel() noexcept;  // allocates nothing
  lumicut_status status() const;
  double seconds() const;

 private:
  using Clock = std::chrono::steady_clock;
  double seconds_locked() const;

  mutable std::mutex mutex_;
  std::shared_ptr<Progress> run_ = std::make_shared<Progress>(), shared_;  // shared_: made when it is asked for
  int32_t state_ = LUMICUT_IDLE;
  Clock::time_point start_{}, end_{};
};

// Runs fn(progress) as the object's work.
template <typename Fn>
void run_work(Work& work, Fn&& fn) {
  const std::shared_ptr<Progress> progress = work.begin();
  const CurrentWork current(progress.get());
  try {
    fn(*progress);
    work.end(LUMICUT_DONE);
  } catch (...) {
    work.end(progress->cancelled() ? LUMICUT_STOPPED : LUMICUT_FAILED);
    throw;
  }
}

// {"seconds", "phases", "counters", "values", "peak_bytes"}; see docs/c_abi.md.
std::string stats_json(double seconds, const Stats& stats);
// Most memory this process has had, and has now, in bytes (Linux; 0 where not known).
uint64_t peak_memory();
uint64_t resident_memory();

}  // namespace lumicut

struct lumicut_device_t : lumicut::ObjectOf<lumicut_device_t> {
  static constexpr auto kKind = lumicut::HandleKind::device;
  lumicut_device_t(int threads, const lumicut::Log& host_log);

  lumicut::Arena arena;
  lumicut::Log log;
  std::string stats_text;
};

struct lumicut_accel_t : lumicut::ObjectOf<lumicut_accel_t> {
  static constexpr auto kKind = lumicut::HandleKind::accel;
  lumicut::Ref<lumicut_device_t> device;
  std::vector<lumicut::Vec3f> positions;
  std::vector<uint32_t> indices;
  std::unique_ptr<lumicut::Accel> accel;
  const lumicut::Bvh* bvh = nullptr;  // `accel`, where it is ours
  std::string stats_text;
};

struct lumicut_scene_t : lumicut::ObjectOf<lumicut_scene_t> {
  static constexpr auto kKind = lumicut::HandleKind::scene;
  lumicut_scene_t(lumicut_device_t& d, lumicut::Scene::Config config) : device(d), scene(std::move(config)) {}

  // Throws INVALID_STATE where the scene was changed since its last commit, or never had one.
  void require_committed() const;

  lumicut::Ref<lumicut_device_t> device;
  lumicut::AccessGuard gate{lumicut::HandleKind::scene};
  lumicut::Work work;
  lumicut::Scene scene;
  std::vector<lumicut::ProfileRef> profiles;  // for lights that are set after
  bool changed = true;                        // beside the camera; which needs no new build and no new lights
  bool camera_changed = false;
  std::unique_ptr<lumicut::Stats> stats = std::make_unique<lumicut::Stats>();
  std::string stats_text;
};

struct lumicut_integrator_t : lumicut::ObjectOf<lumicut_integrator_t>, lumicut::Preparation {
  static constexpr auto kKind = lumicut::HandleKind::integrator;
  lumicut_integrator_t(lumicut_device_t& d, const lumicut::IntegratorEntry& e) : Preparation(e), device(d) {}

  // Preparation::prepare with its own parameters, in the device's arena.
  void prepare_for(lumicut_scene_t& scene, lumicut::Progress& progress, lumicut::Stats& into);
  // The scene that `prepared` is of.
  lumicut_scene_t& prepared_scene() const;
  // The lights of `prepared` as hosts see them, until it is prepared again. From many threads.
  const lumicut::HostVpls& prepared_lights();

  lumicut::Ref<lumicut_device_t> device;
  lumicut::AccessGuard gate{lumicut::HandleKind::integrator};
  std::mutex shown_mutex;
  std::shared_ptr<const lumicut::VplSet> shown_of;  // what `shown` shows
  lumicut::HostVpls shown;
  lumicut::Work work;
  std::unique_ptr<lumicut::Stats> stats = std::make_unique<lumicut::Stats>();
  std::string stats_text;
};

namespace lumicut {
// Keeps the scene for as long as it is held (Prepared::scene_owner).
std::shared_ptr<const void> owner_of(lumicut_scene_t& scene);
}  // namespace lumicut
