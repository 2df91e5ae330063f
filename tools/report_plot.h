// Plots of the report: inline SVG on logarithmic axes, readable without colour (each series has its own marker).
#pragma once

#include <string>
#include <vector>

namespace lumicut::tools {

struct PlotPoint {
  double x, y;  // > 0; others are left out
  std::string label;
};

struct PlotSeries {
  std::string name;
  std::vector<PlotPoint> points;  // joined in the order of x
};

struct Plot {
  std::string id, title, x_label, y_label;
  bool percent_y = false;  // labels are the values times 100, with %
  bool guide = false;      // a dashed line of slope 1: what grows in proportion
  std::vector<PlotSeries> series;
};

// A <figure>; "" when no point can be shown.
std::string plot_svg(const Plot& plot);

// &, <, >, " as entities.
std::string html_text(const std::string& text);

}  // namespace lumicut::tools
