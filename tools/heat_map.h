// Pictures of what a point cost and how far it is off: heat maps of an image's count layers [thesis Fig. 3.8] and maps
// of its relative error.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "tools/false_color.h"

namespace lumicut::tools {

// A layer of an image that counts something at each point.
struct CountLayer {
  const char* name;   // of the layer
  const char* title;  // under the picture
};
inline constexpr std::array<CountLayer, 3> kCountLayers = {
    {{"bounds", "error bounds a point"}, {"cut_size", "clusters a point"}, {"rays", "shadow rays a point"}}};

// Log false colour; `range` {0, 0}: decades around the values.
ColorImage heat_map(const std::vector<float>& counts, int width, int height, const std::string& title,
                    std::array<double, 2> range = {0, 0});

// Relative errors (fractions): with sign linear around 0, else logarithmic over three decades below `top`. top 0: 1,
// and with sign the 99th percentile of the magnitudes, rounded up.
ColorImage error_color_map(const std::vector<float>& errors, int width, int height, bool with_sign, double top);

}  // namespace lumicut::tools
