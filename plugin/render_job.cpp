#include "plugin/render_job.h"

#include <cstring>

#include "plugin/check.h"

using namespace lumicut;

namespace {
constexpr size_t kMaxGroups = 256;
uint32_t tiles_across(uint32_t length, uint32_t tile) { return (length + tile - 1) / tile; }
}  // namespace

lumicut_render_t::lumicut_render_t(lumicut_integrator_t& integrator, lumicut_scene_t& scene, const FrameOptions& o,
                                   IterationOptions iterations)
    : options(o),
      integrator_(integrator),
      scene_(scene),
      columns_(tiles_across(o.crop.width(), o.tile_size)),
      rows_(tiles_across(o.crop.height(), o.tile_size)),
      done_(size_t{columns_} * rows_) {
  using_integrator_ = integrator.gate.change("a render");
  using_scene_ = scene.gate.read("a render");
  scene.require_committed();
  std::vector<uint32_t> groups;
  if (iterations.groups) groups = light_groups(scene.scene);
  if (!scene.scene.has_camera()) fail_state("lumicut_scene: it has no camera");
  if (scene.device.get() != integrator.device.get())
    fail_argument("lumicut_scene: it belongs to another device than the integrator");
  if (integrator.host_lights != nullptr && integrator.params.common().compensate)
    fail_argument(
        "parameter compensate: only lights that the library traced can be compensated, and the host set its own");
  if (integrator.host_lights != nullptr && integrator.params.common().importance)
    fail_argument(
        "parameter importance: it puts lights that the library traces where the camera sees them, and the host set its "
        "own");
  if (iterations.groups && integrator.entry.light_source == LightSource::emitters)
    fail_argument(std::string("lumicut_render_desc.flags: ") + integrator.entry.id +
                  " has no virtual lights, so LUMICUT_GROUPS means nothing to it");
  if (groups.size() > kMaxGroups)
    fail_argument("lumicut_render_desc.flags: LUMICUT_GROUPS with " + number_text(uint64_t{groups.size()}) +
                  " light groups; at most " + number_text(uint64_t{kMaxGroups}) + " can be told apart in one render");
  const uint64_t bytes = render_bytes(o.crop, iterations, groups.size(), o.denoise);
  check_render_bytes(o.crop, bytes);
  stats.set_value("estimated_bytes", static_cast<double>(bytes));
  loop_ = std::make_unique<RenderLoop>(integrator, scene.scene, owner_of(scene), o, std::move(iterations),
                                       std::move(groups));
  progress_ = work.begin();
  thread_ = std::thread([this] { run(); });
}

lumicut_render_t::~lumicut_render_t() {
  work.cancel();
  if (thread_.joinable()) thread_.join();
}

void lumicut_render_t::run() noexcept {
  lumicut_result result = LUMICUT_OK;
  std::exception_ptr failure;
  try {
    integrator_->device->arena.run([this] {
      stats.set_value("start_bytes", static_cast<double>(resident_memory()));
      loop_->run(*progress_, stats, [this](const Rect& tile) { tile_done(tile); });
    });
  } catch (...) {
    result = report_exception();
    failure = std::current_exception();
  }
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
  failure_ = failure;
  work.end(result == LUMICUT_OK ? LUMICUT_DONE : (failed ? LUMICUT_FAILED : LUMICUT_STOPPED));
  over_ = true;
  ended_.notify_all();
}

const std::vector<uint8_t>& lumicut_render_t::checkpoint() {
  if (!loop_->iterations().checkpoints)
    fail_state("lumicut_render_checkpoint: the render was started without LUMICUT_CHECKPOINTS");
  const std::lock_guard lock(mutex_);
  if (auto last = loop_->state().checkpoint) shown_checkpoint_ = std::move(last);
  return *shown_checkpoint_;
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
  const RenderLoop::State state = loop_->state();
  const uint32_t count = loop_->iterations().count;
  s.passes_done = state.iterations, s.passes_total = count;
  s.error = state.error;
  // Of iterations without end: those of the one that runs.
  s.tiles_total = done_.size() * std::max<uint64_t>(count, count == 0 ? state.iterations + 1 : 1);
  return s;
}

std::exception_ptr lumicut_render_t::wait(uint32_t milliseconds) const {
  std::unique_lock lock(mutex_);
  const auto over = [this] { return over_; };
  if (milliseconds == LUMICUT_FOREVER)
    ended_.wait(lock, over);
  else
    ended_.wait_for(lock, std::chrono::milliseconds(milliseconds), over);
  return over_ ? failure_ : nullptr;
}

Rect lumicut_render_t::next_tile() {
  const std::lock_guard lock(mutex_);
  if (tiles_.empty()) return {};
  const Rect tile = tiles_.front();
  tiles_.pop_front();
  return tile;
}

void lumicut_render_t::read_plane(const Rect& rect, size_t components, float* out,
                                  const std::function<const float*(uint32_t, uint32_t)>& pixel) {
  std::fill(out, out + size_t{rect.width()} * rect.height() * components, 0.0f);
  const auto tile_of = [this](uint32_t x, uint32_t origin) { return (x - origin) / options.tile_size; };
  for (uint32_t row = tile_of(rect.y0, options.crop.y0); row <= tile_of(rect.y1 - 1, options.crop.y0); ++row)
    for (uint32_t column = tile_of(rect.x0, options.crop.x0); column <= tile_of(rect.x1 - 1, options.crop.x0);
         ++column) {
      if (done_[size_t{row} * columns_ + column].load(std::memory_order_acquire) == 0) continue;
      const Rect tile = tile_rect(column, row);
      const uint32_t x0 = std::max(tile.x0, rect.x0), x1 = std::min(tile.x1, rect.x1);
      for (uint32_t y = std::max(tile.y0, rect.y0); y < std::min(tile.y1, rect.y1); ++y)
        std::memcpy(out + (size_t{y - rect.y0} * rect.width() + (x0 - rect.x0)) * components, pixel(x0, y),
                    (x1 - x0) * components * sizeof(float));
    }
}
