// Results of `lumicut bench`, made into a page by `lumicut report`.
#include <CLI/CLI.hpp>

#include "io/file_error.h"
#include "tests/fuzz/fuzz.h"
#include "tools/commands.h"

using namespace lumicut;

// main.cpp has them, which is not part of this program.
volatile std::sig_atomic_t tools::interrupted = 0;
void tools::catch_interrupts() {}
tools::NothingToLose::NothingToLose() = default;
tools::NothingToLose::~NothingToLose() = default;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const fuzz::Folder folder;
  [[maybe_unused]] static const bool quiet = std::freopen("/dev/null", "w", stdout) != nullptr;
  const std::string results = folder.write("results.json", fuzz::text_of(data, size));
  CLI::App app;
  tools::add_report(app);
  try {
    app.parse({folder / "page.html", "-o", results, "report"});  // last word first
  } catch (const io::FileError&) {
  }
  return 0;
}
