// lumicut-geometry: the geometry library from the command line.
#include <unistd.h>

#include <cmath>
#include <csignal>
#include <cstdio>
#include <iostream>
#include <iterator>
#include <new>

#include "core/error.h"
#include "geometry/command/commands.h"
#include "geometry/csv.h"
#include "io/atomic_file.h"
#include "io/file_error.h"
#include "io/picture_ending.h"
#include "io/standard_streams.h"
#include "io/text_lines.h"

namespace lumicut {

std::istringstream open_text(const std::string& path) {
  if (path == "-")
    return std::istringstream(std::string(std::istreambuf_iterator<char>(std::cin), std::istreambuf_iterator<char>()));
  std::string text = io::read_whole_file(path);
  io::refuse_utf16(text, path);
  return std::istringstream(std::move(text));
}

void check_output(const std::string& path) {
  if (!path.empty() && path != "-") io::check_writable(path);
}

void write_text(const std::string& path, const std::string& text) {
  if (path == "-") {
    std::fwrite(text.data(), 1, text.size(), stdout);
  } else {
    io::write_whole_file(path, text);
  }
}

void write_points(const std::string& path, const std::vector<Point2>& points, const std::vector<uint32_t>& chosen) {
  std::string text = "index,x,y\n";
  char line[96];
  for (const uint32_t i : chosen) {
    std::snprintf(line, sizeof line, "%u,%.17g,%.17g\n", i, points[i].x, points[i].y);
    text += line;
  }
  write_text(path, text);
}

std::vector<uint32_t> read_indices(const std::string& path, size_t count, const char* of) {
  auto file = open_text(path);
  return read_indices_csv(file, path, count, of);
}

void add_picture_option(CLI::App& command, const std::string& option, std::string& path, const std::string& what,
                        std::initializer_list<std::string_view> kinds) {
  command.add_option(option, path, what)->check([kinds = std::vector(kinds)](const std::string& given) {
    return io::wrong_picture_ending(given, kinds);
  });
}

void add_picture(CLI::App& command, std::string& path, int& size, const std::string& what) {
  add_picture_option(command, "--picture", path, what, {".svg", ".png"});
  command.add_option("--size", size, "Its size in pixels")->check(CLI::Range(50, 10000));
}

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

void check_finite(const char* option, double value) {
  if (!std::isfinite(value)) fail_argument(std::string(option) + " is " + std::to_string(value));
}

ProgressLine::ProgressLine()
    : thread_([this] {
        std::unique_lock lock(mutex_);
        const auto start = std::chrono::steady_clock::now();
        for (auto wait = std::chrono::milliseconds(1000); !ended_.wait_for(lock, wait, [this] { return over_; });
             wait = std::chrono::milliseconds(250)) {
          const std::string share =
              progress_.fraction() > 0 ? std::to_string(static_cast<int>(100 * progress_.fraction())) + " %, " : "";
          std::fprintf(stderr, "\r%-60s",
                       (std::string(progress_.phase()) + ": " + share +
                        std::to_string(static_cast<int>(seconds_since(start))) + " s")
                           .c_str());
          shown_ = true;
        }
        if (shown_) std::fprintf(stderr, "\r%60s\r", "");
      }) {}
ProgressLine::~ProgressLine() {
  {
    const std::lock_guard lock(mutex_);
    over_ = true;
  }
  ended_.notify_all();
  thread_.join();
}

namespace {

enum ExitCode { kFailed = 1, kBadInput = 2, kInterrupted = 130 };

// Files are written whole or not at all, whenever it comes.
void end_at_interrupts() {
  struct sigaction action {};
  action.sa_handler = [](int) {
    constexpr char kText[] = "\nlumicut-geometry: interrupted\n";
    if (write(STDERR_FILENO, kText, sizeof(kText) - 1) < 0) {
    }
    _exit(kInterrupted);
  };
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

int run(int argc, char** argv) {
  CLI::App app{"Ball trees, sliding hulls, hitting sets and epsilon-nets for disks, face clusters on deforming meshes"};
  app.name("lumicut-geometry");
  app.require_subcommand(1);
  app.set_version_flag("--version", "lumicut-geometry " LUMICUT_VERSION_TEXT);
  std::vector<std::pair<CLI::App*, Command>> commands;
  for (const auto add :
       {add_balltree, add_hitting_set, add_hull, add_independent_set, add_instance, add_net, add_recluster}) {
    Command command = add(app);
    commands.emplace_back(app.get_subcommands({}).back(), std::move(command));
  }
  // An empty one is what a script makes of a variable that is not set.
  const CLI::Validator not_empty([](const std::string& text) { return std::string(text.empty() ? "is empty" : ""); },
                                 "");
  for (CLI::App* command : app.get_subcommands({}))
    for (CLI::Option* option : command->get_options())
      if (option->get_items_expected_max() > 0) option->check(not_empty);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : kBadInput;  // --help is an error of code 0
  }
  try {
    for (const auto& [parsed, command] : commands)
      if (*parsed) return command();
    return kFailed;
  } catch (const Error& e) {
    const bool input = e.code() == ErrorCode::invalid_argument || e.code() == ErrorCode::invalid_state;
    std::fprintf(stderr, "lumicut-geometry: %s\n", e.what());
    return input ? kBadInput : kFailed;
  } catch (const std::bad_alloc&) {
    std::fputs("lumicut-geometry: out of memory\n", stderr);
    return kFailed;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "lumicut-geometry: %s\n", e.what());
    return kFailed;
  }
}

}  // namespace
}  // namespace lumicut

int main(int argc, char** argv) {
  lumicut::io::open_standard_streams();
  lumicut::end_at_interrupts();
  return lumicut::io::close_standard_output("lumicut-geometry", lumicut::run(argc, argv), 1);
}
