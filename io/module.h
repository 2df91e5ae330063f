// Modules of the command: what brings many libraries is loaded when it is first asked for.
#pragma once

#include <string>

namespace lumicut::io {

// The datum `symbol` of lib/lumicut/NAME.so beside the program; never closed. Throws FileError, about the file that it is
// needed for, where that fails.
const void* module_entry(const std::string& file, const char* name, const char* symbol);

template <typename Module>
const Module* load_module(const std::string& file, const char* name, const char* symbol) {
  return *static_cast<const Module* const*>(module_entry(file, name, symbol));
}

}  // namespace lumicut::io
