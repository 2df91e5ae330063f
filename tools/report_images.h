// The pictures of one group of results, ready for a page: all of one size, one exposure, one scale a quantity.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tools/false_color.h"

namespace lumicut::tools {

struct ReportPicture {
  std::string label;  // "LC 2 %: relative error"
  std::string run;    // "reference", or the run's name
  std::string kind;   // "image", "error", "signed", "bounds", "cut_size", "rays"
  std::string png;    // data URI
  int width = 0, height = 0;
};

struct ReportGroup {
  std::string name, scene;
  std::vector<ReportPicture> pictures;
  std::vector<std::pair<std::string, FalseColor>> scales;  // kind, scale: for the legends
  std::vector<std::string> missing;                        // files that are not there
};

// One group a scene, sample count, number of lights and seed that has images. Files are looked for beside
// `results_file`. `most` is the largest side in pixels; bigger images are averaged down. Throws FileError for files
// that are broken.
std::vector<ReportGroup> report_groups(const nlohmann::ordered_json& results, const std::string& results_file,
                                       int most);

}  // namespace lumicut::tools
