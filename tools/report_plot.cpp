#include "tools/report_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "tools/false_color.h"

namespace lumicut::tools {

namespace {

constexpr double kWidth = 640, kHeight = 400, kLeft = 64, kRight = 16, kTop = 16, kBottom = 52;
constexpr size_t kColors = 8;  // classes s0 ... s7 of report.css

// Around (0, 0), about 9 wide.
constexpr const char* kMarkers[] = {
    "M-4.5,0a4.5,4.5 0 1,0 9,0a4.5,4.5 0 1,0 -9,0z",         // disk
    "M-4,-4h8v8h-8z",                                        // square
    "M0,-5.2l5,8.6h-10z",                                    // triangle
    "M0,-5.5l5,5.5l-5,5.5l-5,-5.5z",                         // diamond
    "M0,5.2l5,-8.6h-10z",                                    // triangle, point down
    "M-5,-1.5h3.5v-3.5h3v3.5h3.5v3h-3.5v3.5h-3v-3.5h-3.5z",  // plus
    "M-5,-5l5,3l5,-3l-3,5l3,5l-5,-3l-5,3l3,-5z",             // star
};

struct Axis {
  double low, high, from, to;
  double at(double value) const { return from + (to - from) * std::log(value / low) / std::log(high / low); }
};

Axis axis_of(const std::vector<float>& values, double from, double to) {
  const auto range = decade_range(values);
  return {range[0], range[1], from, to};
}

std::vector<double> ticks_of(const Axis& axis) {
  FalseColor scale;
  scale.low = axis.low, scale.high = axis.high;
  return bar_ticks(scale);
}

std::string marker(size_t series, double x, double y, const std::string& title) {
  return fmt::format("<path class=\"mark s{}\" d=\"{}\" transform=\"translate({:.1f},{:.1f})\">{}</path>",
                     series % kColors, kMarkers[series % std::size(kMarkers)], x, y,
                     title.empty() ? "" : "<title>" + html_text(title) + "</title>");
}

}  // namespace

std::string html_text(const std::string& text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

std::string plot_svg(const Plot& plot) {
  std::vector<PlotSeries> all = plot.series;
  std::vector<float> xs, ys;
  for (PlotSeries& s : all) {
    std::erase_if(s.points, [](const PlotPoint& p) { return !(p.x > 0 && p.y > 0 && std::isfinite(p.x + p.y)); });
    std::stable_sort(s.points.begin(), s.points.end(), [](const auto& a, const auto& b) { return a.x < b.x; });
    for (const PlotPoint& p : s.points) xs.push_back(static_cast<float>(p.x)), ys.push_back(static_cast<float>(p.y));
  }
  std::erase_if(all, [](const PlotSeries& s) { return s.points.empty(); });
  if (all.empty()) return "";
  const Axis x = axis_of(xs, kLeft, kWidth - kRight), y = axis_of(ys, kHeight - kBottom, kTop);
  std::string out = fmt::format(
      "<figure class=\"plot\" id=\"{0}\">\n<svg viewBox=\"0 0 {1} {2}\" role=\"img\" aria-labelledby=\"{0}-title\">\n"
      "<title id=\"{0}-title\">{3}: {4} against {5}, logarithmic axes. The numbers are in the tables.</title>\n",
      html_text(plot.id), kWidth, kHeight, html_text(plot.title), html_text(plot.y_label), html_text(plot.x_label));
  for (const double tick : ticks_of(x))
    out += fmt::format(
        "<line class=\"grid\" x1=\"{0:.1f}\" x2=\"{0:.1f}\" y1=\"{1}\" y2=\"{2}\"/><text class=\"tick\" x=\"{0:.1f}\" "
        "y=\"{3}\" text-anchor=\"middle\">{4}</text>\n",
        x.at(tick), kTop, kHeight - kBottom, kHeight - kBottom + 16, label_text(tick, false));
  for (const double tick : ticks_of(y))
    out += fmt::format(
        "<line class=\"grid\" x1=\"{1}\" x2=\"{2}\" y1=\"{0:.1f}\" y2=\"{0:.1f}\"/><text class=\"tick\" x=\"{3}\" "
        "y=\"{4:.1f}\" text-anchor=\"end\">{5}</text>\n",
        y.at(tick), kLeft, kWidth - kRight, kLeft - 6, y.at(tick) + 4, label_text(tick, plot.percent_y));
  out += fmt::format("<text class=\"axis\" x=\"{}\" y=\"{}\" text-anchor=\"middle\">{}</text>\n",
                     (kLeft + kWidth - kRight) / 2, kHeight - 12, html_text(plot.x_label));
  out +=
      fmt::format("<text class=\"axis\" transform=\"translate(14,{}) rotate(-90)\" text-anchor=\"middle\">{}</text>\n",
                  (kTop + kHeight - kBottom) / 2, html_text(plot.y_label));
  if (plot.guide) {
    // From the first point of the first series, as far as both axes reach.
    const PlotPoint& p = all[0].points[0];
    const double reach = std::min(x.high / p.x, y.high / p.y);
    if (reach > 1)
      out += fmt::format("<line class=\"guide\" x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\"/>\n", x.at(p.x),
                         y.at(p.y), x.at(p.x * reach), y.at(p.y * reach));
  }
  std::string legend;
  for (size_t i = 0; i < all.size(); ++i) {
    std::string path;
    for (const PlotPoint& p : all[i].points)
      path += fmt::format("{}{:.1f},{:.1f}", path.empty() ? "M" : "L", x.at(p.x), y.at(p.y));
    out += fmt::format("<g class=\"series\" data-name=\"{}\"><path class=\"line s{}\" d=\"{}\"/>",
                       html_text(all[i].name), i % kColors, path);
    for (const PlotPoint& p : all[i].points) out += marker(i, x.at(p.x), y.at(p.y), p.label);
    out += "</g>\n";
    legend += "<li><svg width=\"14\" height=\"14\" viewBox=\"-7 -7 14 14\" aria-hidden=\"true\">" +
              marker(i, 0, 0, "") + "</svg>" + html_text(all[i].name) + "</li>";
  }
  out += "</svg>\n<figcaption>" + html_text(plot.title) +
         (plot.guide ? " (dashed: in proportion to the number of lights)" : "") +
         "</figcaption>\n<ul class=\"legend\">" + legend + "</ul>\n</figure>\n";
  return out;
}

}  // namespace lumicut::tools
