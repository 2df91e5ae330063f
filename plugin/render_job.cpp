#include "plugin/render_job.h"

#include <cstring>

#include "plugin/check.h"

using namespace lumicut;

namespace {
uint32_t tiles_across(uint32_t length, uint32_t tile) { return (length + tile - 1) / tile; }
}  // namespace

lumicut_render_t::lumicut_render_t(lumicut_integrator_t& integrator, lumicut_scene_t& scene, const FrameOptions& o,
                                   PassOptions passes)
    : options(o),
      integrator_(integrator),
      scene_(scene),
      film_(o.crop),
      passes_(std::move(passes)),
      columns_(tiles_across(o.crop.width(), o.tile_size)),
      rows_(tiles_across(o.crop.height(), o.tile_size)),
      done_(size_t{columns_} * rows_) {
  using_integrator_ = integrator.gate.change("a render");
  using_scene_ = scene.gate.read("a render");
  scene.require_committed();
  if (!scene.scene.has_camera()) fail_state("lumicut_scene: it has no camera");
  if (scene.device.get() != integrator.device.get())
    fail_argument("lumicut_scene: it belongs to another device than the integrator");
  if (integrator.host_lights != nullptr && integrator.params.boolean("compensate"))
    fail_argument(
        "parameter compensate: only lights that the library traced can be compensated, and the host set its own");
  progress_ = work.begin();
  thread_ = std::thread([this] { run(); });
}

lumicut_render_t::~lumicut_render_t() {
  work.cancel();
  if (thread_.joinable()) thread_.join();
}

void lumicut_render_t::run() noexcept {
  const lumicut_result result = guard([this] { integrator_->device->arena.run([this] { render(); }); });
  const bool failed = result != LUMICUT_OK && result != LUMICUT_CANCELLED;
  const auto& log = integrator_->device->log;
  guard([&] {
    if (failed)
      log(LogLevel::error, std::string("render failed: ") + last_error());
    else
      log(LogLevel::info, result == LUMICUT_OK ? "render done" : "render cancelled");
  });
  // Integrator and scene are free before anybody can see that the render is over.
  using_integrator_.drop();
  using_scene_.drop();
  const std::lock_guard lock(mutex_);
  result_ = result;
  guard([&] { error_ = result == LUMICUT_OK ? "" : last_error(); });
  work.end(result == LUMICUT_OK ? LUMICUT_DONE : (failed ? LUMICUT_FAILED : LUMICUT_STOPPED));
  over_ = true;
  ended_.notify_all();
}

FrameOptions lumicut_render_t::frame_options(const Prepared& prepared) const {
  FrameOptions frame = options;
  frame.seed = static_cast<uint64_t>(prepared.params->integer("seed"));
  if (prepared.params->boolean("compensate") && integrator_->entry.light_source == LightSource::virtual_lights)
    frame.compensate = clamp_distance(*prepared.params, scene_->scene);
  return frame;
}

void lumicut_render_t::render() {
  stats.set_value("start_bytes", static_cast<double>(resident_memory()));
  progress_->check();
  if (passes_.progressive()) return render_passes();
  integrator_->prepare(*scene_, *progress_, stats);
  const Prepared& prepared = *integrator_->prepared;
  {
    const PhaseTimer timer(stats, "render");
    render_frame(scene_->scene, *prepared.method, frame_options(prepared), film_, {*progress_, stats},
                 [this](const Rect& tile) { tile_done(tile); });
  }
  progress_->check();
  const std::lock_guard lock(mutex_);
  passes_done_ = 1;
}

void lumicut_render_t::render_passes() {
  PassMean mean(options.crop, passes_.confidence);
  const uint64_t key =
      passes_key(scene_->scene, integrator_->entry.id, params_text(integrator_->params), options, passes_.confidence);
  uint32_t done = 0;
  double error = std::numeric_limits<double>::infinity(), last_seconds = 0.0;
  const auto finish_pass = [&] {
    {
      const std::lock_guard lock(film_mutex_);
      mean.write_error(done, film_);
    }
    error = mean.error(film_, done);
    stats.set_value("passes", done);
    if (done >= 2) stats.set_value("error", error);
    std::vector<uint8_t> bytes;
    if (passes_.checkpoints) bytes = save_passes(key, done, mean, film_);
    const std::lock_guard lock(mutex_);
    passes_done_ = done, error_of_passes_ = error;
    checkpoint_ = std::move(bytes);
  };
  if (!passes_.resume.empty()) {
    done = load_passes(passes_.resume, key, mean, film_);
    passes_.resume = {};
    finish_pass();
    for (uint32_t row = 0; row < rows_; ++row)
      for (uint32_t column = 0; column < columns_; ++column) tile_done(tile_rect(column, row));
  }
  Film pass(options.crop);
  while (done == 0 || !enough_passes(passes_, done, work.seconds(), last_seconds, error)) {
    const double start = work.seconds();
    integrator_->prepare(*scene_, params_of_pass(integrator_->params, done, scene_->scene), *progress_, stats);
    const Prepared& prepared = *integrator_->prepared;
    FrameOptions frame = frame_options(prepared);
    frame.jitter = true;
    {
      const PhaseTimer timer(stats, "render");
      render_frame(scene_->scene, *prepared.method, frame, pass, {*progress_, stats}, [&](const Rect& tile) {
        {
          const std::lock_guard lock(film_mutex_);
          mean.add(pass, tile, uint64_t{done} + 1, film_);
        }
        tile_done(tile);
      });
    }
    progress_->check();
    ++done;
    last_seconds = work.seconds() - start;
    finish_pass();
  }
}

const std::vector<uint8_t>& lumicut_render_t::checkpoint() {
  if (!passes_.checkpoints) fail_state("lumicut_render_checkpoint: the render was started without LUMICUT_CHECKPOINTS");
  const std::lock_guard lock(mutex_);
  shown_checkpoint_ = checkpoint_;
  return shown_checkpoint_;
}

Rect lumicut_render_t::tile_rect(uint32_t column, uint32_t row) const {
  const Rect& c = options.crop;
  const uint32_t t = options.tile_size, x = c.x0 + column * t, y = c.y0 + row * t;
  return {x, y, std::min(c.x1, x + t), std::min(c.y1, y + t)};
}

void lumicut_render_t::tile_done(const Rect& tile) {
  const uint32_t column = (tile.x0 - options.crop.x0) / options.tile_size;
  const uint32_t row = (tile.y0 - options.crop.y0) / options.tile_size;
  done_[size_t{row} * columns_ + column].store(1, std::memory_order_release);
  const std::lock_guard lock(mutex_);
  tiles_.push_back(tile);
  ++tiles_done_;
}

lumicut_status lumicut_render_t::status() const {
  lumicut_status s = work.status();
  const std::lock_guard lock(mutex_);
  s.tiles_done = tiles_done_;
  s.passes_done = passes_done_, s.passes_total = passes_.passes;
  s.error = error_of_passes_;
  // Of passes without end: those of the pass that runs.
  s.tiles_total = done_.size() * std::max<uint64_t>(passes_.passes, passes_.passes == 0 ? passes_done_ + 1 : 1);
  return s;
}

std::optional<Error> lumicut_render_t::wait(uint32_t milliseconds) const {
  std::unique_lock lock(mutex_);
  const auto over = [this] { return over_; };
  if (milliseconds == LUMICUT_FOREVER)
    ended_.wait(lock, over);
  else
    ended_.wait_for(lock, std::chrono::milliseconds(milliseconds), over);
  if (!over_ || result_ == LUMICUT_OK) return std::nullopt;
  return Error(static_cast<ErrorCode>(result_), error_);
}

Rect lumicut_render_t::next_tile() {
  const std::lock_guard lock(mutex_);
  if (tiles_.empty()) return {};
  const Rect tile = tiles_.front();
  tiles_.pop_front();
  return tile;
}

void lumicut_render_t::read(const ChannelInfo& channel, const Rect& rect, float* out) {
  const size_t components = channel.components;
  std::fill(out, out + size_t{rect.width()} * rect.height() * components, 0.0f);
  std::unique_lock lock(film_mutex_, std::defer_lock);
  if (passes_.progressive()) lock.lock();
  const auto tile_of = [this](uint32_t x, uint32_t origin) { return (x - origin) / options.tile_size; };
  for (uint32_t row = tile_of(rect.y0, options.crop.y0); row <= tile_of(rect.y1 - 1, options.crop.y0); ++row)
    for (uint32_t column = tile_of(rect.x0, options.crop.x0); column <= tile_of(rect.x1 - 1, options.crop.x0);
         ++column) {
      if (done_[size_t{row} * columns_ + column].load(std::memory_order_acquire) == 0) continue;
      const Rect tile = tile_rect(column, row);
      const uint32_t x0 = std::max(tile.x0, rect.x0), x1 = std::min(tile.x1, rect.x1);
      for (uint32_t y = std::max(tile.y0, rect.y0); y < std::min(tile.y1, rect.y1); ++y)
        std::memcpy(out + (size_t{y - rect.y0} * rect.width() + (x0 - rect.x0)) * components,
                    film_.pixel(channel.channel, x0, y), (x1 - x0) * components * sizeof(float));
    }
}
