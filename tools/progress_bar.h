// One line on the terminal that says what runs and how far it is. Silent where stderr is no terminal.
#pragma once

#include <string>

namespace lumicut::tools {

class ProgressBar {
 public:
  explicit ProgressBar(bool quiet);
  ~ProgressBar();  // wipes the line
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;
  void show(const std::string& phase, double fraction, double seconds);
  void wipe();

 private:
  bool shown_ = false, enabled_;
};

}  // namespace lumicut::tools
