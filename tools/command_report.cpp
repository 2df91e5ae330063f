#include <CLI/CLI.hpp>
#include "tools/commands.h"
namespace lumicut::tools {
void add_report(CLI::App&) {}
}  // namespace lumicut::tools
