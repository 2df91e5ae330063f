// A frame rendered in the background: its thread, its film, and the queue of tiles that are done.
#pragma once

#include <atomic>
#include <condition_variable>
#include <deque>
#include <limits>
#include <thread>

#include "film/film.h"
#include "integrators/frame.h"
#include "plugin/objects.h"
#include "plugin/passes.h"

struct lumicut_render_t : lumicut::ObjectOf<lumicut_render_t> {
  static constexpr auto kKind = lumicut::HandleKind::render;

  // Takes both objects for the length of the render, and starts it. Throws INVALID_STATE where they are in use.
  lumicut_render_t(lumicut_integrator_t& integrator, lumicut_scene_t& scene, const lumicut::FrameOptions& options,
                   lumicut::PassOptions passes);
  // Cancels what runs and waits for it.
  ~lumicut_render_t();

  lumicut_status status() const;
  // Waits until the render ends, at most so long. Gives the error of a render that failed or was cancelled.
  std::optional<lumicut::Error> wait(uint32_t milliseconds) const;
  // The next tile that is done, once each; x1 = 0 where there is none now.
  lumicut::Rect next_tile();
  // State after the last whole pass; stays until the next call.
  const std::vector<uint8_t>& checkpoint();
  // Tiles that are not done yet read as 0.
  void read(const lumicut::ChannelInfo& channel, const lumicut::Rect& rect, float* out);

  lumicut::Work work;
  lumicut::Stats stats;
  std::string stats_text;
  const lumicut::FrameOptions options;

 private:
  void run() noexcept;
  void render();
  void render_passes();
  lumicut::FrameOptions frame_options(const lumicut::Prepared& prepared) const;
  void tile_done(const lumicut::Rect& tile);
  lumicut::Rect tile_rect(uint32_t column, uint32_t row) const;

  lumicut::Ref<lumicut_integrator_t> integrator_;
  lumicut::Ref<lumicut_scene_t> scene_;
  lumicut::Gate::Hold using_integrator_, using_scene_;
  std::shared_ptr<lumicut::Progress> progress_;
  lumicut::Film film_;  // of passes: their mean
  lumicut::PassOptions passes_;
  const uint32_t columns_, rows_;
  std::vector<std::atomic<uint8_t>> done_;  // a tile: its pixels may be read

  mutable std::mutex mutex_;
  mutable std::condition_variable ended_;
  std::deque<lumicut::Rect> tiles_;
  uint64_t tiles_done_ = 0;
  uint32_t passes_done_ = 0;
  double error_of_passes_ = std::numeric_limits<double>::infinity();
  std::vector<uint8_t> checkpoint_, shown_checkpoint_;
  mutable std::mutex film_mutex_;  // of passes: pixels change while hosts read them
  bool over_ = false;
  lumicut_result result_ = LUMICUT_OK;
  std::string error_;
  std::thread thread_;  // last: all above stands before it starts
};
