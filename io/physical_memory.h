#pragma once

#include <unistd.h>

#include <cstdint>
#include <fstream>
#include <string>

namespace lumicut::io {

// This machine's, in bytes.
inline uint64_t physical_memory() {
  return static_cast<uint64_t>(sysconf(_SC_PHYS_PAGES)) * static_cast<uint64_t>(sysconf(_SC_PAGESIZE));
}

// The most that this process held, in bytes; 0 where /proc does not say. getrusage's figure is also that of the process
// which started this one.
inline uint64_t peak_memory() {
  std::ifstream status("/proc/self/status");
  uint64_t kilobytes = 0;
  for (std::string word; status >> word;)
    if (word == "VmHWM:") status >> kilobytes;
  return kilobytes * 1024;
}

}  // namespace lumicut::io
