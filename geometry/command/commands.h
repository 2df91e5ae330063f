// The commands of lumicut-geometry: each adds itself, with its options, to the command line and returns what runs it.
#pragma once

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <condition_variable>
#include <functional>
#include <initializer_list>
#include <mutex>
#include <sstream>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "core/progress.h"
#include "geometry/point2.h"

namespace lumicut {

using Command = std::function<int()>;

Command add_balltree(CLI::App& app);
Command add_hitting_set(CLI::App& app);
Command add_hull(CLI::App& app);
Command add_independent_set(CLI::App& app);
Command add_instance(CLI::App& app);
Command add_net(CLI::App& app);
Command add_recluster(CLI::App& app);

// A text file, "-": standard input.
std::istringstream open_text(const std::string& path);
// Refuses a place that cannot be written, before any work. "-" is standard output, "" is none.
void check_output(const std::string& path);
void write_text(const std::string& path, const std::string& text);
// Refuses names that end as another kind of picture does.
void add_picture_option(CLI::App& command, const std::string& option, std::string& path, const std::string& what,
                        std::initializer_list<std::string_view> kinds);
// --picture, told by `what`, and --size.
void add_picture(CLI::App& command, std::string& path, int& size, const std::string& what);
// index,x,y
void write_points(const std::string& path, const std::vector<Point2>& points, const std::vector<uint32_t>& chosen);

// The first column of a CSV, as the other commands write it: indices below `count`; `of` names what they count.
std::vector<uint32_t> read_indices(const std::string& path, size_t count, const char* of);

// On a terminal, while one lives: the phase, how much of it is done and for how long, from the second second on.
class ProgressLine {
 public:
  ProgressLine();
  ~ProgressLine();
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;
  Progress& progress() { return progress_; }

 private:
  Progress progress_;
  std::mutex mutex_;
  std::condition_variable ended_;
  bool over_ = isatty(STDERR_FILENO) == 0, shown_ = false;
  std::thread thread_;  // last: it uses the others
};

double seconds_since(std::chrono::steady_clock::time_point start);
// CLI::Range lets NaN pass.
void check_finite(const char* option, double value);

}  // namespace lumicut
