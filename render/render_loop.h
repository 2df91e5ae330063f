// A whole render: prepares (light paths, trees), renders a frame or iterations of it, keeps their mean, estimates its
// error, writes checkpoints. What a host, a test and a bench drive alike; threads, handles and tiles' queues are theirs.
#pragma once

#include <functional>
#include <limits>
#include <memory>
#include <mutex>
#include <vector>

#include "film/film.h"
#include "film/iteration_mean.h"
#include "render/frame.h"
#include "render/iterations.h"
#include "render/preparation.h"

namespace lumicut {

class RenderLoop {
 public:
  struct State {
    uint32_t iterations = 0;  // that are whole
    double error = std::numeric_limits<double>::infinity();
    std::shared_ptr<const std::vector<uint8_t>> checkpoint;  // after the last of them; null where none is kept
  };

  // `groups`: those of the film; empty: one image of all light. The scene, which is committed and has a camera, and the
  // preparation outlive this; `scene_owner` keeps the scene beyond that, for what was prepared (Prepared::scene_owner).
  RenderLoop(Preparation& preparation, const Scene& scene, std::shared_ptr<const void> scene_owner,
             const FrameOptions& options, IterationOptions iterations, std::vector<uint32_t> groups);

  // Renders to the end, in the calling thread's arena. `tile_done` is called from any thread, once a tile and iteration,
  // after its pixels are written. Throws Error(cancelled), and others.
  void run(Progress& progress, Stats& stats, const std::function<void(const Rect&)>& tile_done);

  // From any thread, while it runs too.
  State state() const;
  const FrameOptions& options() const { return options_; }
  const IterationOptions& iterations() const { return iterations_; }
  // Fixed at the start.
  const std::vector<uint32_t>& groups() const { return film_.groups(); }
  // Calls fn(film). Of iterations it is their mean, whose pixels change until the end: it stands still meanwhile. Of one
  // frame the tiles that are done may be read.
  template <typename Fn>
  void read(Fn&& fn) const {
    std::unique_lock lock(film_mutex_, std::defer_lock);
    if (progressive_) lock.lock();
    fn(film_);
  }

 private:
  // What renders: the method as it was prepared, or one for the lights of each group; where gloss is traced, two more, for
  // the lights whose gloss rays bring and for the others.
  struct OfGroup {
    VplSet lights, traced_lights, other_lights;
    std::unique_ptr<Integrator> method, traced, others;
  };
  void render_iterations(Progress& progress, Stats& stats, const std::function<void(const Rect&)>& tile_done);
  FrameSize whole_frame() const { return {options_.width, options_.height}; }
  Params as_wanted(Params params) const;
  FrameOptions frame_options(const Prepared& prepared) const;
  FrameLight frame_light(const Prepared& prepared) const;
  std::vector<GroupMethod> methods(const Prepared& prepared, std::vector<OfGroup>& of_groups, Progress& progress,
                                   Stats& stats) const;

  Preparation& preparation_;
  const Scene& scene_;
  const std::shared_ptr<const void> scene_owner_;
  const FrameOptions options_;
  IterationOptions iterations_;
  const bool progressive_;
  Film film_;                      // of iterations: their mean
  mutable std::mutex film_mutex_;  // of iterations: pixels change while others read them
  mutable std::mutex state_mutex_;
  State state_;
  std::optional<EvenSky> sky_;  // where rays bring its gloss
};

}  // namespace lumicut
