// lumicut: renders scenes with many lights, compares images, tells what the library offers. See docs/command_line.md.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <cstdio>
#include <new>
#include <system_error>

#include "io/file_error.h"
#include "io/library.h"
#include "io/standard_streams.h"
#include "tools/commands.h"

namespace lumicut::tools {

volatile std::sig_atomic_t interrupted = 0;

namespace {
volatile std::sig_atomic_t nothing_to_lose = 0;
}

NothingToLose::NothingToLose() {
  nothing_to_lose = 1;
  if (interrupted) nothing_to_lose = 0, throw Interrupted();
}
NothingToLose::~NothingToLose() { nothing_to_lose = 0; }

void catch_interrupts() {
  struct sigaction action {};
  action.sa_handler = [](int) {
    interrupted = 1;
    if (!nothing_to_lose) return;
    constexpr char kText[] = "\nlumicut: interrupted; nothing was written\n";
    if (write(STDERR_FILENO, kText, sizeof(kText) - 1) < 0) {
    }
    _exit(kInterrupted);
  };
  action.sa_flags = static_cast<int>(SA_RESETHAND);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

namespace {

// `output_error`: errno of what could not be printed.
int run(int argc, char** argv, int& output_error) {
  CLI::App app(
      "Lumicut renders global illumination from many virtual lights.\n\n"
      "  lumicut info                                         what the library offers\n"
      "  lumicut check scene.json                             what looks wrong in a scene, and what it will cost\n"
      "  lumicut render scene.json -i lightcuts -o out.exr    an image\n"
      "  lumicut render scene.json -i exhaustive -o ref.exr   the same from all lights: the reference\n"
      "  lumicut compare out.exr ref.exr                      how far the one is from the other\n"
      "  lumicut errors scene.json -i lightcuts               what its error is made of\n"
      "  lumicut convert room.fbx room.json                   a scene of another program as JSON\n"
      "  lumicut mix out.exr --gain 1=0.5 -o mixed.exr        one lamp dimmed, without a render\n"
      "  lumicut bench plan.json -o out/bench                 scenes and methods: times, counts, errors\n"
      "  lumicut report out/bench/results.json -o page.html   the same as a page\n");
  app.name("lumicut");
  app.require_subcommand(1);
  app.set_version_flag("--version", version_text, "Print the version, and what can trace rays (--accel)");
  app.footer(
      "Exit codes: 0 done, 1 failed, 2 wrong command line, 3 a file is missing, wrong or cannot be written, 130 "
      "interrupted.");
  add_render(app);
  add_flythrough(app);
  add_compare(app);
  add_errors(app);
  add_convert(app);
  add_mix(app);
  add_bench(app);
  add_report(app);
  add_check(app);
  add_info(app);
  // An empty one is what a script makes of a variable that is not set.
  const CLI::Validator not_empty([](const std::string& text) { return std::string(text.empty() ? "is empty" : ""); },
                                 "");
  for (CLI::App* command : app.get_subcommands({}))
    for (CLI::Option* option : command->get_options())
      if (option->get_items_expected_max() > 0) option->check(not_empty);
  const auto complain = [](const char* text, int code) {
    print_error("lumicut: {}\n", text);
    return code;
  };
  try {
    app.parse(argc, argv);
    return kOk;
  } catch (const CLI::ParseError& error) {
    if (argc > 1 && argv[1][0] != '-' && app.get_subcommands().empty()) {
      std::string names;
      for (const CLI::App* command : app.get_subcommands({}))
        names += (names.empty() ? "" : ", ") + command->get_name();
      return complain(fmt::format("no command \"{}\"; there are {}", argv[1], names).c_str(), kUsage);
    }
    errno = 0;
    const int code = app.exit(error) == 0 ? kOk : kUsage;  // --help is an error of code 0
    if (std::ferror(stdout)) output_error = errno;         // it has more than the stream holds back
    return code;
  } catch (const SilentExit& error) {
    return error.code();
  } catch (const Interrupted& error) {
    return complain(error.what(), kInterrupted);
  } catch (const UsageError& error) {
    return complain(error.what(), kUsage);
  } catch (const io::FileError& error) {
    return complain(error.what(), kBadFile);
  } catch (const std::bad_alloc&) {
    return complain("out of memory", kFailed);
  } catch (const std::system_error& error) {
    if (!std::ferror(stdout)) return complain(error.what(), kFailed);
    output_error = error.code().value();
    return kBadFile;  // close_standard_output tells of it
  } catch (const std::exception& error) {
    return complain(error.what(), kFailed);
  }
}

}  // namespace
}  // namespace lumicut::tools

// What may still be thrown is want of memory for the last words.
int main(int argc, char** argv) {  // NOLINT(bugprone-exception-escape)
  lumicut::io::open_standard_streams();
  int output_error = 0;
  const int code = lumicut::tools::run(argc, argv, output_error);
  return lumicut::io::close_standard_output("lumicut", code, lumicut::tools::kBadFile, output_error);
}
