// Files that other files name, on whatever machine they were written.
#pragma once

#include <string>
#include <string_view>

namespace lumicut::io {

// At most 60 bytes of it, without control characters: for messages.
std::string shown(std::string_view text, size_t most = 60);

struct FoundFile {
  std::string path;    // "": none
  std::string remark;  // how it differs from what was asked for
};

// A file that `name` in `file` may mean: relative to the folder of `file`, with slashes either way, in other case, or,
// where `name` is an absolute path of another machine, its last part beside `file`.
FoundFile find_beside(const std::string& file, const std::string& name);

// Whether two paths lead to one file, by links too.
bool same_file(const std::string& a, const std::string& b);

// Why nothing was found: "the mesh a.ply does not exist", "the name of the mesh is empty", "... is a folder".
std::string missing_file(const std::string& what, const std::string& file, const std::string& name);

}  // namespace lumicut::io
