#include "io/find_beside.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <filesystem>

#include "io/text_lines.h"

namespace lumicut::io {

std::string shown(std::string_view text, size_t most) {
  std::string out;
  for (const char c : text.substr(0, most)) out += static_cast<unsigned char>(c) >= ' ' && c != '\x7f' ? c : '?';
  return out;
}

namespace {

bool is_file(const std::filesystem::path& path) {
  std::error_code code;
  return std::filesystem::exists(path, code) && !std::filesystem::is_directory(path, code);
}

// The same path in whatever case its folders and its name are written; "" when there is none.
std::filesystem::path in_other_case(const std::filesystem::path& path) {
  std::filesystem::path found;
  for (const auto& part : path) {
    std::error_code code;
    std::filesystem::path next = found / part;
    if (!std::filesystem::exists(next, code)) {
      next.clear();
      for (std::filesystem::directory_iterator i(found.empty() ? "." : found, code), end; !code && i != end;
           i.increment(code))
        if (lower(i->path().filename().string()) == lower(part.string()) && (next.empty() || i->path() < next))
          next = found / i->path().filename();
      if (next.empty()) return "";
    }
    found = next;
  }
  return found;
}

}  // namespace

FoundFile find_beside(const std::string& file, const std::string& name) {
  const auto folder = std::filesystem::path(file).parent_path();
  std::string slashes = name;
  std::replace(slashes.begin(), slashes.end(), '\\', '/');
  const bool drive = slashes.size() > 2 && std::isalpha(static_cast<unsigned char>(slashes[0])) && slashes[1] == ':';
  const bool absolute = drive || slashes[0] == '/';
  for (const std::string& spelling : {name, slashes})
    if (is_file(folder / spelling)) return {(folder / spelling).string(), ""};
  if (!drive)
    if (const auto path = in_other_case(folder / slashes); is_file(path))
      return {path.string(), fmt::format("{} is read in its place", shown(path.filename().string()))};
  if (absolute) {
    const auto last = folder / slashes.substr(slashes.rfind(drive && slashes[2] != '/' ? ':' : '/') + 1);
    for (const auto& path : {last, in_other_case(last)})
      if (is_file(path)) return {path.string(), fmt::format("{} is read in its place", shown(path.string()))};
  }
  return {};
}

bool same_file(const std::string& a, const std::string& b) {
  std::error_code code;
  return a == b || std::filesystem::equivalent(a, b, code);
}

std::string missing_file(const std::string& what, const std::string& file, const std::string& name) {
  if (name.empty()) return fmt::format("the name of the {} is empty", what);
  std::error_code code;
  const bool folder = std::filesystem::is_directory(std::filesystem::path(file).parent_path() / name, code);
  return fmt::format("the {} {} {}", what, shown(name), folder ? "is a folder" : "does not exist");
}

}  // namespace lumicut::io
