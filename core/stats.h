// Counters that no machine changes (rays, bounds, clusters), and seconds per phase.
#pragma once

#include <chrono>
#include <cstdint>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

namespace lumicut {

// Summed in registers by each task and added once: no atomics in a hot loop.
struct Counters {
  uint64_t points = 0;    // shaded points
  uint64_t rays = 0;      // shadow rays
  uint64_t bounds = 0;    // error bounds evaluated, one per (point or point node, light node)
  uint64_t clusters = 0;  // clusters or lights that contribute, summed over points
  Counters& operator+=(const Counters& o) {
    points += o.points, rays += o.rays, bounds += o.bounds, clusters += o.clusters;
    return *this;
  }
};

class Stats {
 public:
  void add(const Counters& c);
  void add_phase(const std::string& name, double seconds);  // phases of one name add up
  void set_value(const std::string& name, double value);
  Counters counters() const;
  std::vector<std::pair<std::string, double>> phases() const;
  std::vector<std::pair<std::string, double>> values() const;

 private:
  mutable std::mutex mutex_;
  Counters counters_;
  std::vector<std::pair<std::string, double>> phases_, values_;
};

// Adds the wall time of its scope to a phase.
class PhaseTimer {
 public:
  PhaseTimer(Stats& stats, std::string name) : stats_(stats), name_(std::move(name)) {}
  ~PhaseTimer() {
    stats_.add_phase(name_, std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count());
  }
  PhaseTimer(const PhaseTimer&) = delete;
  PhaseTimer& operator=(const PhaseTimer&) = delete;

 private:
  Stats& stats_;
  std::string name_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace lumicut
