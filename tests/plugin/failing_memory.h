// Allocations that fail when a test says so, in this process and in every library it loads: this program's malloc and
// its kin stand in front of the C library's, mmap in front of the system call, and oneTBB takes them too.
#pragma once

namespace failing_memory {

// Of the allocations while a Scope stands, number `n` (from 0) fails; `all_after`: and all behind it.
void arm(long n, bool all_after);
// How many failed since then. Until the next arm() none fails.
long disarm();
// How many there were in scopes since the last arm().
long seen();
class Scope {
 public:
  Scope();
  ~Scope();
};
// Blocks that are allocated now, by all threads.
long live_blocks();

}  // namespace failing_memory
