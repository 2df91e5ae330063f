#include "plugin/render_job.h"

#include <cstring>

#include "plugin/check.h"

using namespace lumicut;

namespace {
constexpr size_t kMaxGroups = 256;
uint32_t tiles_across(uint32_t length, uint32_t tile) { return (length + tile - 1) / tile; }
}  // namespace

lumicut_render_t::lumicut_render_t(lumicut_integrator_t& integrator, lumicut_scene_t& scene, const FrameOptions& o,
                                   PassOptions passes)
    : options(o),
      integrator_(integrator),
      scene_(scene),
      film_(Rect{}),
      passes_(std::move(passes)),
      columns_(tiles_across(o.crop.width(), o.tile_size)),
      rows_(tiles_across(o.crop.height(), o.tile_size)),
      done_(size_t{columns_} * rows_) {
  using_integrator_ = integrator.gate.change("a render");
  using_scene_ = scene.gate.read("a render");
  scene.require_committed();
  std::vector<uint32_t> groups;
  if (passes_.groups) groups = light_groups(scene.scene);
  if (!scene.scene.has_camera()) fail_state("lumicut_scene: it has no camera");
  if (scene.device.get() != integrator.device.get())
    fail_argument("lumicut_scene: it belongs to another device than the integrator");
  if (integrator.host_lights != nullptr && integrator.params.boolean("compensate"))
    fail_argument(
        "parameter compensate: only lights that the library traced can be compensated, and the host set its own");
  if (passes_.groups && integrator.entry.light_source == LightSource::emitters)
    fail_argument(std::string("lumicut_render_desc.flags: ") + integrator.entry.id +
                  " has no virtual lights, so LUMICUT_GROUPS means nothing to it");
  if (groups.size() > kMaxGroups)
    fail_argument("lumicut_render_desc.flags: LUMICUT_GROUPS with " + number_text(uint64_t{groups.size()}) +
                  " light groups; at most " + number_text(uint64_t{kMaxGroups}) + " can be told apart in one render");
  const uint64_t bytes = render_bytes(o.crop, passes_, groups.size());
  check_render_bytes(o.crop, bytes);
  stats.set_value("estimated_bytes", static_cast<double>(bytes));
  film_ = Film(o.crop, std::move(groups));
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
    integrator_->device->arena.run([this] { render(); });
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

FrameOptions lumicut_render_t::frame_options(const Prepared& prepared) const {
  FrameOptions frame = options;
  frame.seed = static_cast<uint64_t>(prepared.params->integer("seed"));
  if (prepared.params->boolean("compensate") && integrator_->entry.light_source == LightSource::virtual_lights)
    frame.compensate = clamp_distance(*prepared.params, scene_->scene);
  frame.spheres = sphere_scale(*prepared.params) > 0.0f;
  return frame;
}

std::vector<GroupMethod> lumicut_render_t::methods(const Prepared& prepared, std::vector<OfGroup>& of_groups) {
  if (!passes_.groups || film_.groups().empty()) return {{0, prepared.method.get()}};
  of_groups.clear();
  of_groups.resize(film_.groups().size());
  for (const Vpl& v : prepared.standing_off.lights) {
    const auto at = std::lower_bound(film_.groups().begin(), film_.groups().end(), v.group);
    if (at != film_.groups().end() && *at == v.group)
      of_groups[static_cast<size_t>(at - film_.groups().begin())].lights.lights.push_back(v);
  }
  std::vector<GroupMethod> all;
  for (size_t g = 0; g < of_groups.size(); ++g) {
    progress_->check();
    if (!of_groups[g].lights.lights.empty()) {
      of_groups[g].method = integrator_->entry.create();
      of_groups[g].method->prepare(scene_->scene, of_groups[g].lights, *prepared.params, {*progress_, stats});
    }
    all.push_back({film_.groups()[g], of_groups[g].method.get()});
  }
  return all;
}

void lumicut_render_t::render() {
  stats.set_value("start_bytes", static_cast<double>(resident_memory()));
  progress_->check();
  if (passes_.progressive()) return render_passes();
  integrator_->prepare(*scene_, *progress_, stats);
  const Prepared& prepared = *integrator_->prepared;
  {
    const PhaseTimer timer(stats, "render");
    std::vector<OfGroup> of_groups;
    render_frame(scene_->scene, methods(prepared, of_groups), frame_options(prepared), film_, {*progress_, stats},
                 [this](const Rect& tile) { tile_done(tile); });
  }
  progress_->check();
  const std::lock_guard lock(mutex_);
  passes_done_ = 1;
}

void lumicut_render_t::render_passes() {
  PassMean mean(options.crop, passes_.confidence);
  const std::string key = passes_key(scene_->scene, integrator_->entry.id, integrator_->params,
                                     integrator_->host_lights.get(), options, passes_);
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
    std::shared_ptr<const std::vector<uint8_t>> bytes;
    if (passes_.checkpoints) bytes = std::make_shared<const std::vector<uint8_t>>(save_passes(key, done, mean, film_));
    const std::lock_guard lock(mutex_);
    passes_done_ = done, error_of_passes_ = error;
    checkpoint_ = std::move(bytes);
  };
  if (!passes_.resume.empty()) {
    done = load_passes(passes_.resume, key, mean, film_);
    passes_.resume = std::vector<uint8_t>();  // frees it, which "= {}" does not
    finish_pass();
    for (uint32_t row = 0; row < rows_; ++row)
      for (uint32_t column = 0; column < columns_; ++column) tile_done(tile_rect(column, row));
  }
  const auto enough = [&] { return done > 0 && enough_passes(passes_, done, work.seconds(), last_seconds, error); };
  if (enough()) {
    // All was in the checkpoint. The integrator has the lights of the last pass, as after any render.
    integrator_->prepare(*scene_, params_of_pass(integrator_->params, done - 1, scene_->scene), *progress_, stats);
    return;
  }
  Film pass(options.crop, film_.groups());
  std::vector<OfGroup> of_groups;
  do {
    const double start = work.seconds();
    integrator_->prepare(*scene_, params_of_pass(integrator_->params, done, scene_->scene), *progress_, stats);
    const Prepared& prepared = *integrator_->prepared;
    FrameOptions frame = frame_options(prepared);
    frame.camera_samples = {static_cast<uint64_t>(integrator_->params.integer("seed")), uint64_t{done} * frame.samples};
    {
      const PhaseTimer timer(stats, "render");
      render_frame(scene_->scene, methods(prepared, of_groups), frame, pass, {*progress_, stats},
                   [&](const Rect& tile) {
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
  } while (!enough());
}

const std::vector<uint8_t>& lumicut_render_t::checkpoint() {
  if (!passes_.checkpoints) fail_state("lumicut_render_checkpoint: the render was started without LUMICUT_CHECKPOINTS");
  const std::lock_guard lock(mutex_);
  if (checkpoint_ != nullptr) shown_checkpoint_ = checkpoint_;
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
  s.passes_done = passes_done_, s.passes_total = passes_.passes;
  s.error = error_of_passes_;
  // Of passes without end: those of the pass that runs.
  s.tiles_total = done_.size() * std::max<uint64_t>(passes_.passes, passes_.passes == 0 ? passes_done_ + 1 : 1);
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
        std::memcpy(out + (size_t{y - rect.y0} * rect.width() + (x0 - rect.x0)) * components, pixel(x0, y),
                    (x1 - x0) * components * sizeof(float));
    }
}
