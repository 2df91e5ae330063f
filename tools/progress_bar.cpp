#include "tools/progress_bar.h"

#include <unistd.h>

#include <algorithm>
#include <cstdio>

#include "tools/commands.h"

namespace lumicut::tools {

ProgressBar::ProgressBar(bool quiet) : enabled_(!quiet && isatty(STDERR_FILENO)) {}

ProgressBar::~ProgressBar() { wipe(); }

void ProgressBar::show(const std::string& phase, double fraction, double seconds) {
  if (!enabled_) return;
  constexpr int kWidth = 30;
  const double f = std::clamp(fraction, 0.0, 1.0);
  const int done = static_cast<int>(f * kWidth);
  print_error("\r\033[K[{}{}] {:3.0f} %  {}  {:.1f} s", std::string(static_cast<size_t>(done), '#'),
              std::string(static_cast<size_t>(kWidth - done), '.'), f * 100, phase, seconds);
  std::fflush(stderr);
  shown_ = true;
}

void ProgressBar::wipe() {
  if (!shown_) return;
  print_error("\r\033[K");
  std::fflush(stderr);
  shown_ = false;
}

}  // namespace lumicut::tools
