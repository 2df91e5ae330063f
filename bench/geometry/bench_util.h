// What the geometry benchmarks share: a header that names the command and the machine, CPU seconds, and memory.
#pragma once

#include <sys/resource.h>
#include <sys/utsname.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <string>

#include "bench/smoke.h"

namespace lumicut::bench {

inline void print_header(const char* what, int argc, char** argv, uint64_t seed) {
  std::string cpu = "unknown processor", line;
  for (std::ifstream in("/proc/cpuinfo"); std::getline(in, line);)
    if (line.rfind("model name", 0) == 0) {
      cpu = line.substr(line.find(':') + 2);
      break;
    }
  utsname u{};
  uname(&u);
  const std::string path = argv[0];
  std::printf("# %s\n# command: %s", what, path.substr(path.rfind('/') + 1).c_str());
  for (int i = 1; i < argc; ++i) std::printf(" %s", argv[i]);
  std::printf("\n# machine: %s, %s; CPU seconds of one thread; seed %llu\n", cpu.c_str(), u.release,
              static_cast<unsigned long long>(seed));
}

// CPU seconds of this process: other work on the machine hardly moves it.
inline double cpu_seconds() {
  timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

template <typename Fn>
double time_of(Fn&& fn) {
  const double start = cpu_seconds();
  fn();
  return cpu_seconds() - start;
}

inline double peak_megabytes() {
  rusage u{};
  getrusage(RUSAGE_SELF, &u);
  return static_cast<double>(u.ru_maxrss) / 1024.0;
}

// Where the scenes are: LUMICUT_SCENES, else ../shared/scenes beside the project. Empty when absent.
inline std::string scenes_folder() {
  const char* set = std::getenv("LUMICUT_SCENES");
#ifdef LUMICUT_SOURCE_DIR
  const std::string folder = set ? set : LUMICUT_SOURCE_DIR "/../shared/scenes";
#else
  const std::string folder = set ? set : "../shared/scenes";
#endif
  return std::ifstream(folder + "/README.md").good() ? folder : std::string();
}

}  // namespace lumicut::bench
