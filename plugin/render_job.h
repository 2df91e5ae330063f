// A frame rendered in the background: its thread, its film, and the queue of tiles that are done.
#pragma once

#include <atomic>
#include <condition_variable>
#include <deque>
#include <exception>
#include <functional>
#include <limits>
#include <thread>

#include "plugin/objects.h"
#include "render/render_loop.h"

struct lumicut_render_t : lumicut::ObjectOf<lumicut_render_t> {
  static constexpr auto kKind = lumicut::HandleKind::render;

  // Takes both objects for the length of the render, and starts it. Throws INVALID_STATE where they are in use.
  lumicut_render_t(lumicut_integrator_t& integrator, lumicut_scene_t& scene, const lumicut::FrameOptions& options,
                   lumicut::IterationOptions passes);
  // Cancels what runs and waits for it.
  ~lumicut_render_t();

  lumicut_status status() const;
  // Waits until the render ends, at most so long. Gives what a render that failed or was cancelled threw.
  std::exception_ptr wait(uint32_t milliseconds) const;
  // The next tile that is done, once each; x1 = 0 where there is none now.
  lumicut::Rect next_tile();
  // State after the last whole pass; stays until the next call.
  const std::vector<uint8_t>& checkpoint();
  // Tiles that are not done yet read as 0, and so do channels that were not asked for.
  void read(const lumicut::ChannelInfo& channel, const lumicut::Rect& rect, float* out) {
    loop_->read([&](const lumicut::Film& film) {
      if (!film.has(channel.channel))
        std::fill_n(out, size_t{rect.width()} * rect.height() * channel.components, 0.0f);
      else
        read_plane(rect, channel.components, out,
                   [&](uint32_t x, uint32_t y) { return film.pixel(channel.channel, x, y); });
    });
  }
  // The same of one light group; `index` into groups().
  void read_group(size_t index, const lumicut::Rect& rect, float* out) {
    loop_->read([&](const lumicut::Film& film) {
      read_plane(rect, 3, out, [&](uint32_t x, uint32_t y) { return film.group_pixel(index, x, y); });
    });
  }
  const std::vector<uint32_t>& groups() const { return loop_->groups(); }

  lumicut::Work work;
  lumicut::Stats stats;
  std::string stats_text;
  const lumicut::FrameOptions options;

 private:
  void run() noexcept;
  void read_plane(const lumicut::Rect& rect, size_t components, float* out,
                  const std::function<const float*(uint32_t, uint32_t)>& pixel);
  void tile_done(const lumicut::Rect& tile);
  lumicut::Rect tile_rect(uint32_t column, uint32_t row) const;

  lumicut::Ref<lumicut_integrator_t> integrator_;
  lumicut::Ref<lumicut_scene_t> scene_;
  lumicut::AccessGuard::Hold using_integrator_, using_scene_;
  std::shared_ptr<lumicut::Progress> progress_;
  std::unique_ptr<lumicut::RenderLoop> loop_;
  const uint32_t columns_, rows_;
  std::vector<std::atomic<uint8_t>> done_;  // a tile: its pixels may be read

  mutable std::mutex mutex_;
  mutable std::condition_variable ended_;
  std::deque<lumicut::Rect> tiles_;
  uint64_t tiles_done_ = 0;
  // The one that a host looks at, which may be older than the last.
  std::shared_ptr<const std::vector<uint8_t>> shown_checkpoint_ = std::make_shared<const std::vector<uint8_t>>();
  bool over_ = false;
  std::exception_ptr failure_;
  std::thread thread_;  // last: all above stands before it starts
};
