// Plans of `lumicut bench`.
#include "io/file_error.h"
#include "io/library.h"
#include "tests/fuzz/fuzz.h"
#include "tools/bench_plan.h"
#include "tools/commands.h"

using namespace lumicut;

// main.cpp has them, which is not part of this program.
volatile std::sig_atomic_t tools::interrupted = 0;
void tools::catch_interrupts() {}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const io::Library library;
  try {
    tools::parse_bench_plan(std::string(fuzz::text_of(data, size)), "plan.json", "/nowhere", library.api());
  } catch (const io::FileError&) {
  }
  return 0;
}
