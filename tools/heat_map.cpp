#include "tools/heat_map.h"

#include <algorithm>
#include <cmath>

namespace lumicut::tools {

ColorImage heat_map(const std::vector<float>& counts, int width, int height, const std::string& title,
                    std::array<double, 2> range) {
  if (!(range[0] > 0)) range = decade_range(counts);
  FalseColor options;
  options.low = range[0], options.high = range[1];
  options.title = title;
  return false_color_with_bar(counts, width, height, options);
}

ColorImage error_color_map(const std::vector<float>& errors, int width, int height, bool with_sign, double top) {
  FalseColor options;
  options.percent = true;
  options.title = with_sign ? "relative error, signed" : "relative error";
  options.high = top > 0 ? top : 1;
  options.low = options.high / 1000;
  if (!with_sign) return false_color_with_bar(errors, width, height, options);
  options.scale = ColorScale::diverging;
  if (!(top > 0)) {
    std::vector<float> sizes;
    for (const float e : errors)
      if (std::isfinite(e)) sizes.push_back(std::abs(e));
    std::sort(sizes.begin(), sizes.end());
    const double p99 = sizes.empty() ? 0 : double{sizes[(sizes.size() - 1) * 99 / 100]};
    options.high = round_up_125(std::max(p99, 1e-3));
  }
  return false_color_with_bar(errors, width, height, options);
}

}  // namespace lumicut::tools
