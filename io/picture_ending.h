// Names of pictures that do not fit what is written.
#pragma once

#include <algorithm>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>

#include "io/text_lines.h"

namespace lumicut::io {

// What is wrong with the name of a picture of one of these kinds (".exr"): it ends as another kind of picture does.
// Empty where it does not; devices, pipes and names of no kind may hold any.
inline std::string wrong_picture_ending(const std::string& path, std::span<const std::string_view> kinds) {
  constexpr std::string_view known[] = {".exr", ".png", ".svg", ".jpg",  ".jpeg", ".tif", ".tiff", ".hdr",
                                        ".bmp", ".gif", ".tga", ".webp", ".pdf",  ".pfm", ".ppm",  ".dds"};
  const std::string ending = lower(std::filesystem::path(path).extension().string());
  if (std::ranges::find(known, ending) == std::end(known) || std::ranges::find(kinds, ending) != kinds.end()) return {};
  std::string wanted;
  for (const std::string_view kind : kinds) wanted += (wanted.empty() ? "" : " or ") + std::string(kind);
  return path + " ends in " + ending + ", and would hold " + wanted;
}

}  // namespace lumicut::io
