#include "plugin/objects.h"

#include <cstdio>

#include "plugin/check.h"

namespace lumicut {

std::shared_ptr<Progress> Work::begin() {
  const std::lock_guard lock(mutex_);
  run_ = std::make_shared<Progress>();
  state_ = LUMICUT_RUNNING;
  start_ = Clock::now();
  return run_;
}

void Work::end(int32_t state) {
  const std::lock_guard lock(mutex_);
  state_ = state;
  end_ = Clock::now();
}

std::shared_ptr<Progress> Work::share() {
  const std::lock_guard lock(mutex_);
  if (shared_ == nullptr) shared_ = std::make_shared<Progress>();
  return shared_;
}

void Work::cancel() noexcept {
  const std::lock_guard lock(mutex_);
  run_->cancel();
  if (shared_ != nullptr) shared_->cancel();
  shared_.reset();
}

double Work::seconds_locked() const {
  if (state_ == LUMICUT_IDLE) return 0.0;
  return std::chrono::duration<double>((state_ == LUMICUT_RUNNING ? Clock::now() : end_) - start_).count();
}

double Work::seconds() const {
  const std::lock_guard lock(mutex_);
  return seconds_locked();
}

lumicut_status Work::status() const {
  const std::lock_guard lock(mutex_);
  lumicut_status s{};
  s.struct_size = sizeof(s);
  s.state = state_;
  s.phase = run_->phase();
  s.fraction = state_ == LUMICUT_DONE ? 1.0 : run_->fraction();
  s.seconds = seconds_locked();
  return s;
}

namespace {

uint64_t proc_status_bytes(const char* key) {
  uint64_t kilobytes = 0;
  if (std::FILE* file = std::fopen("/proc/self/status", "re")) {
    const std::string format = std::string(key) + ": %lu kB";
    char line[256];
    unsigned long value = 0;
    while (std::fgets(line, sizeof(line), file) != nullptr)
      if (std::sscanf(line, format.c_str(), &value) == 1) kilobytes = value;
    std::fclose(file);
  }
  return kilobytes * 1024;
}

std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') out += '\\';
    out += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
  }
  return out + '"';
}

std::string number_or_null(double v) { return std::isfinite(v) ? number_text(v) : "null"; }

std::string object_text(const std::vector<std::pair<std::string, double>>& entries) {
  std::string out = "{";
  for (const auto& [name, value] : entries) {
    if (out.size() > 1) out += ", ";
    out += quoted(name) + ": " + number_or_null(value);
  }
  return out + "}";
}

}  // namespace

uint64_t peak_memory() { return proc_status_bytes("VmHWM"); }
uint64_t resident_memory() { return proc_status_bytes("VmRSS"); }

std::string stats_json(double seconds, const Stats& stats) {
  const Counters c = stats.counters();
  return "{\"seconds\": " + number_or_null(seconds) + ", \"phases\": " + object_text(stats.phases()) +
         ", \"counters\": {\"points\": " + number_text(uint64_t{c.points}) +
         ", \"rays\": " + number_text(uint64_t{c.rays}) + ", \"bounds\": " + number_text(uint64_t{c.bounds}) +
         ", \"clusters\": " + number_text(uint64_t{c.clusters}) + "}, \"values\": " + object_text(stats.values()) +
         ", \"peak_bytes\": " + number_text(peak_memory()) + "}";
}

std::shared_ptr<const void> owner_of(lumicut_scene_t& scene) {
  return std::make_shared<const Ref<lumicut_scene_t>>(scene);
}

}  // namespace lumicut

using namespace lumicut;

lumicut_device_t::lumicut_device_t(int threads, const Log& host_log) : arena(threads), log(host_log) {}

void lumicut_scene_t::require_committed() const {
  if (scene.version() == 0) fail_state("lumicut_scene: it was never committed");
  if (changed || camera_changed) fail_state("lumicut_scene: it was changed since its last commit");
}

void lumicut_integrator_t::prepare_for(lumicut_scene_t& of, Progress& progress, Stats& into) {
  if (of.device.get() != device.get()) fail_argument("lumicut_scene: it belongs to another device than the integrator");
  prepare(of.scene, owner_of(of), params, progress, into);
}

lumicut_scene_t& lumicut_integrator_t::prepared_scene() const {
  return **static_cast<const Ref<lumicut_scene_t>*>(prepared->scene_owner.get());
}

const HostVpls& lumicut_integrator_t::prepared_lights() {
  const std::lock_guard lock(shown_mutex);
  if (shown_of != prepared->vpls) {
    shown = from_vpls(*prepared->vpls);
    shown_of = prepared->vpls;
  }
  return shown;
}
