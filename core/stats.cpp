#include "core/stats.h"

#include <new>

namespace lumicut {

namespace {
using Table = std::vector<std::pair<std::string, double>>;

double& entry(Table& table, const std::string& name) {
  for (auto& [key, value] : table)
    if (key == name) return value;
  return table.emplace_back(name, 0.0).second;
}
}  // namespace

void Stats::add(const Counters& c) {
  const std::lock_guard lock(mutex_);
  counters_ += c;
}
// Timers call it as they end, also while memory is out: a phase that there is no room for is left out.
void Stats::add_phase(const std::string& name, double seconds) {
  const std::lock_guard lock(mutex_);
  try {
    entry(phases_, name) += seconds;
  } catch (const std::bad_alloc&) {
  }
}
void Stats::set_value(const std::string& name, double value) {
  const std::lock_guard lock(mutex_);
  entry(values_, name) = value;
}
Counters Stats::counters() const {
  const std::lock_guard lock(mutex_);
  return counters_;
}
Table Stats::phases() const {
  const std::lock_guard lock(mutex_);
  return phases_;
}
Table Stats::values() const {
  const std::lock_guard lock(mutex_);
  return values_;
}

}  // namespace lumicut
