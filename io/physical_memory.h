#pragma once

#include <unistd.h>

#include <cstdint>

namespace lumicut::io {

// This machine's, in bytes.
inline uint64_t physical_memory() {
  return static_cast<uint64_t>(sysconf(_SC_PHYS_PAGES)) * static_cast<uint64_t>(sysconf(_SC_PAGESIZE));
}

}  // namespace lumicut::io
