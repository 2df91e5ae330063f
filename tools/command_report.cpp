// lumicut report: results of `lumicut bench` as one HTML page that needs nothing else: no network, no other file;
// without scripts all but the slider works.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "io/atomic_file.h"
#include "io/file_error.h"
#include "io/json_reader.h"
#include "lumicut_report_assets.h"
#include "tools/bench_table.h"
#include "tools/commands.h"
#include "tools/report_images.h"
#include "tools/report_plot.h"

namespace lumicut::tools {

using nlohmann::ordered_json;

namespace {

struct Options {
  std::string results, output;
  int most = 640;
};

std::string text_of(const ordered_json& value) { return value.is_string() ? value.get<std::string>() : value.dump(); }

std::string table_html(const Table& table) {
  std::string out = "<div class=\"scroll\"><table>\n<caption>" + html_text(table.title) + "</caption>\n<thead><tr>";
  for (const auto& cell : table.header) out += "<th scope=\"col\">" + html_text(cell) + "</th>";
  out += "</tr></thead>\n<tbody>\n";
  for (const auto& row : table.rows) {
    if (row.size() == 1) {
      out += fmt::format("<tr class=\"block\"><th scope=\"rowgroup\" colspan=\"{}\">{}</th></tr>\n",
                         table.header.size(), html_text(row[0]));
      continue;
    }
    out += "<tr><th scope=\"row\">" + html_text(row[0]) + "</th>";
    for (size_t i = 1; i < row.size(); ++i) out += "<td>" + html_text(row[i]) + "</td>";
    out += "</tr>\n";
  }
  out += "</tbody></table></div>\n";
  if (!table.note.empty()) out += "<p>" + html_text(table.note) + "</p>\n";
  return out;
}

// A colour bar in SVG.
std::string scale_html(const std::string& title, const FalseColor& scale, const std::string& id) {
  const bool both = scale.scale == ColorScale::diverging;
  std::string stops;
  constexpr int kStops = 24;
  for (int i = 0; i <= kStops; ++i) {
    const double t = static_cast<double>(i) / kStops;
    const Srgb8 c = both ? diverging_color(2 * t - 1) : sequential_color(t);
    stops += fmt::format("<stop offset=\"{:.4f}\" stop-color=\"#{:02x}{:02x}{:02x}\"/>", t, c[0], c[1], c[2]);
  }
  std::string out = fmt::format(
      "<span class=\"scale\"><svg viewBox=\"0 0 340 46\" role=\"img\" aria-label=\"Colours of "
      "{0}\"><defs><linearGradient "
      "id=\"{1}\">{2}</linearGradient></defs><text x=\"20\" y=\"11\">{0}</text><rect x=\"20\" y=\"16\" width=\"290\" "
      "height=\"12\" fill=\"url(#{1})\"/>",
      html_text(title), id, stops);
  for (const double tick : bar_ticks(scale)) {
    const double t = both ? (tick / scale.high + 1) / 2 : std::log(tick / scale.low) / std::log(scale.high / scale.low);
    out += fmt::format("<text x=\"{:.1f}\" y=\"41\" text-anchor=\"middle\">{}</text>", 20 + 290 * t,
                       label_text(tick, scale.percent));
  }
  return out + "</svg></span>\n";
}

std::string group_html(const ReportGroup& group, size_t index) {
  const std::string id = fmt::format("gallery{}", index);
  std::string out = "<h3>" + html_text(group.name) + "</h3>\n";
  for (const auto& file : group.missing) out += "<p>Not there: <code>" + html_text(file) + "</code></p>\n";
  if (group.pictures.empty()) return out;
  if (group.pictures.size() > 1)
    out += fmt::format(
        "<div class=\"viewer\" data-gallery=\"{0}\" hidden>\n<div class=\"controls\"><label>Left <select "
        "id=\"{0}-left\"></select></label><label>Right <select id=\"{0}-right\"></select></label></div>\n"
        "<div class=\"stage\"><img alt=\"\"><img class=\"right\" alt=\"\"><span class=\"tag a\"></span><span "
        "class=\"tag "
        "b\"></span></div>\n<input type=\"range\" min=\"0\" max=\"100\" step=\"0.1\" value=\"50\" aria-label=\"Where "
        "the "
        "left picture ends\">\n</div>\n",
        id);
  out += "<div>";
  for (size_t i = 0; i < group.scales.size(); ++i)
    out += scale_html(group.scales[i].first, group.scales[i].second, fmt::format("scale{}-{}", index, i));
  out += "</div>\n<div class=\"gallery\" id=\"" + id + "\">\n";
  for (const ReportPicture& p : group.pictures)
    out += fmt::format(
        "<figure data-kind=\"{}\"><img src=\"{}\" width=\"{}\" height=\"{}\" alt=\"{}\"><figcaption>{}</figcaption>"
        "</figure>\n",
        p.kind, p.png, p.width, p.height, html_text(p.label), html_text(p.label));
  return out + "</div>\n";
}

// Methods of one kind, whatever their numbers: "illumination_cut visibility=full".
std::string family(const ordered_json& row) {
  std::string name = row.at("integrator").get<std::string>();
  for (const auto& [key, value] : row.at("given_parameters").items()) {
    const std::string text = text_of(value);
    char* end = nullptr;
    std::strtod(text.c_str(), &end);
    if (end == text.c_str() || *end != '\0') name += " " + key + "=" + text;
  }
  return name;
}

PlotSeries& series_named(Plot& plot, const std::string& name) {
  for (PlotSeries& s : plot.series)
    if (s.name == name) return s;
  plot.series.push_back({name, {}});
  return plot.series.back();
}

// Error against time, one plot a group and measure; the steps of a search are points too.
std::string error_plots(const ordered_json& results) {
  std::string out;
  std::vector<std::string> groups;
  const auto rows = complete_rows(results);
  for (const auto* row : rows) {
    const std::string name = (*row).at("group").get<std::string>();
    if (std::find(groups.begin(), groups.end(), name) == groups.end()) groups.push_back(name);
  }
  struct Measure {
    const char *key, *label;
    bool percent;
  };
  for (size_t g = 0; g < groups.size(); ++g)
    for (const Measure& measure : {Measure{"mean_relative_error", "mean relative error", true},
                                   Measure{"rmse", "RMSE / mean of the reference", false}}) {
      Plot plot;
      plot.id = fmt::format("error-{}-{}", g, measure.key);
      plot.title = fmt::format("{}: {} against seconds, everything counted", groups[g], measure.label);
      plot.x_label = "seconds", plot.y_label = measure.label, plot.percent_y = measure.percent;
      for (const auto* row : rows) {
        if ((*row).at("group") != groups[g]) continue;
        PlotSeries& series = series_named(plot, family(*row));
        const auto add = [&](const ordered_json& from, const std::string& label) {
          const double x = from.at("total_seconds").get<double>(), y = from.at(measure.key).get<double>();
          series.points.push_back(
              {x, y,
               fmt::format("{}: {:.3g} s, {}", label, x,
                           measure.percent ? fmt::format("{:.3g} %", 100 * y) : fmt::format("{:.4g}", y))});
        };
        const std::string run = (*row).at("run").get<std::string>();
        if (row->contains("match"))
          for (const auto& step : (*row).at("match").at("steps"))
            add(step, fmt::format("{}, {}={:.4g}", run, (*row).at("match").at("vary").get<std::string>(),
                                  step.at("value").get<double>()));
        else
          add(*row, run);
      }
      out += plot_svg(plot);
    }
  return out;
}

// Seconds by number of lights, where there are several.
std::string scaling_plots(const ordered_json& results) {
  std::vector<Plot> plots;
  for (const auto* row : complete_rows(results)) {
    if ((*row).at("vpls_requested").get<int64_t>() == 0) continue;
    const std::string title = fmt::format("{}, {} sample{} a pixel: render seconds by number of virtual lights",
                                          (*row).at("scene").get<std::string>(), (*row).at("samples").get<int64_t>(),
                                          (*row).at("samples") == 1 ? "" : "s");
    auto plot = std::find_if(plots.begin(), plots.end(), [&](const Plot& p) { return p.title == title; });
    if (plot == plots.end()) {
      plots.push_back(
          {fmt::format("scaling-{}", plots.size()), title, "virtual lights", "render seconds", false, true, {}});
      plot = plots.end() - 1;
    }
    const double x = (*row).at("vpls").get<double>(), y = (*row).at("render_seconds").get<double>();
    const std::string run = (*row).at("run").get<std::string>();
    series_named(*plot, run).points.push_back({x, y, fmt::format("{}: {} lights, {:.3g} s", run, x, y)});
  }
  std::string out;
  for (const Plot& plot : plots) {
    std::vector<double> counts;
    for (const auto& s : plot.series)
      for (const auto& p : s.points) counts.push_back(p.x);
    std::sort(counts.begin(), counts.end());
    if (counts.back() > 1.5 * counts.front()) out += plot_svg(plot);
  }
  return out;
}

std::string all_runs(const ordered_json& results) {
  std::string out = "<div class=\"scroll\"><table>\n<caption>Every run: medians of repetitions</caption>\n<thead><tr>";
  for (const char* cell : {"Run", "Scene", "VPLs", "Seed", "Preprocessing (s)", "Render (s)", "Rel. error (%)",
                           "RMSE / mean", "Bias (%)", "Peak (MB)", "Command"})
    out += fmt::format("<th scope=\"col\">{}</th>", cell);
  out += "</tr></thead>\n<tbody>\n";
  for (const auto& row : results.at("rows")) {
    out += "<tr><th scope=\"row\">" + html_text(text_of(row.at("run"))) + "</th><td class=\"name\">" +
           html_text(text_of(row.at("scene"))) + "</td>";
    if (row.contains("failed")) {
      out += "<td colspan=\"9\" class=\"name\">failed: " + html_text(text_of(row.at("failed"))) + "</td></tr>\n";
      continue;
    }
    out += fmt::format(
        "<td>{}</td><td>{}</td><td>{:.3f}</td><td>{:.3f}</td><td>{:.3f}</td><td>{:.5f}</td><td>{:+.3f}</td><td>{:.0f}</"
        "td>"
        "<td class=\"command\">{}</td></tr>\n",
        row.at("vpls").get<int64_t>(), row.at("seed").get<int64_t>(), row.at("preprocess_seconds").get<double>(),
        row.at("render_seconds").get<double>(), 100 * row.at("mean_relative_error").get<double>(),
        row.at("rmse").get<double>(), 100 * row.at("bias").get<double>(), row.at("peak_bytes").get<double>() / 1e6,
        html_text(text_of(row.at("command"))));
  }
  return out + "</tbody></table></div>\n";
}

std::string facts(const ordered_json& results) {
  std::string out = "<dl class=\"facts\">\n";
  const auto add = [&](const std::string& name, const std::string& value) {
    out += "<dt>" + html_text(name) + "</dt><dd>" + html_text(value) + "</dd>\n";
  };
  add("Version", text_of(results.at("version")) + ", " + text_of(results.at("git")));
  const ordered_json& machine = results.at("machine");
  add("Machine", fmt::format("{}, {} threads, {:.0f} GB, load {:.1f} when it began", text_of(machine.at("processor")),
                             machine.at("threads").get<int>(), machine.at("memory_bytes").get<double>() / 1e9,
                             machine.value("load", 0.0)));
  const int threads = results.at("threads").get<int>();
  add("Runs",
      fmt::format("{} threads, {} rays by {}, repeated {}x, medians", threads == 0 ? "all" : std::to_string(threads),
                  results.value("rays", "robust"), text_of(results.at("accel")), results.at("repeat").get<int>()));
  for (const auto& y : results.at("yardsticks"))
    add("Yardstick", fmt::format("{}: {:.2f} Mray/s between random surface points ({}, {})", text_of(y.at("scene")),
                                 y.at("mray_per_second").get<double>(), text_of(y.at("call")), text_of(y.at("accel"))));
  for (const auto& s : results.at("skipped")) add("Skipped", text_of(s.at("scene")) + ": " + text_of(s.at("why")));
  return out + "</dl>\n";
}

std::string page(const ordered_json& results, const std::string& file, int most) {
  const std::string name = "Lumicut: " + text_of(results.at("name"));
  std::string out =
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" "
      "content=\"width=device-width, initial-scale=1\">\n<link rel=\"icon\" href=\"data:,\">\n<title>" +
      html_text(name) + "</title>\n<style>\n" + k_report_css + "</style>\n</head>\n<body>\n<header>\n<h1>" +
      html_text(name) + "</h1>\n<p>" + html_text(text_of(results.at("description"))) +
      "</p>\n<nav aria-label=\"Sections\"><a href=\"#tables\">Tables</a><a href=\"#plots\">Plots</a><a "
      "href=\"#images\">Images</a><a href=\"#runs\">Every run</a></nav>\n" +
      facts(results) + "</header>\n<main>\n<h2 id=\"tables\">Tables</h2>\n";
  for (const Table& table : bench_tables(results)) out += table_html(table);
  const std::string plots = error_plots(results) + scaling_plots(results);
  out += "<h2 id=\"plots\">Plots</h2>\n<div class=\"plots\">\n" + (plots.empty() ? "<p>Nothing to plot.</p>" : plots) +
         "</div>\n<h2 id=\"images\">Images</h2>\n";
  const auto groups = report_groups(results, file, most);
  if (groups.empty()) out += "<p>No images were kept.</p>\n";
  for (size_t i = 0; i < groups.size(); ++i) out += group_html(groups[i], i);
  out += "<h2 id=\"runs\">Every run</h2>\n" + all_runs(results) + "</main>\n<script>\n" + k_report_js +
         "</script>\n</body>\n</html>\n";
  return out;
}

void report(const Options& o) {
  std::string output = o.output;
  if (output.empty()) output = (std::filesystem::path(o.results).parent_path() / "report.html").string();
  io::check_distinct({output}, {o.results});
  io::check_writable(output);
  auto computing = std::make_unique<NothingToLose>();
  const auto results = io::parse_json<ordered_json>(io::read_whole_file(o.results), o.results);
  if (!results.is_object() || !results.contains("format") || results["format"] != "lumicut-bench/1")
    throw io::FileError(o.results, "is no result of `lumicut bench`: its \"format\" is not \"lumicut-bench/1\"");
  std::string html;
  try {
    html = page(results, o.results, o.most);
  } catch (const nlohmann::json::exception& error) {
    throw io::FileError(o.results, fmt::format("lacks what a report needs: {}", error.what()));
  }
  computing.reset();
  stop_if_interrupted();
  io::write_whole_file(output, html);
  fmt::print("{}: {:.1f} MB\n", output, static_cast<double>(html.size()) / 1e6);
}

}  // namespace

void add_report(CLI::App& app) {
  auto* command = app.add_subcommand("report", "Results of `lumicut bench` as one HTML page");
  const auto o = std::make_shared<Options>();
  command->add_option("results", o->results, "results.json of `lumicut bench`")->required();
  command->add_option("-o,--output", o->output, "The page to write (default: report.html beside the results)");
  command->add_option("--max-size", o->most, "Largest side of a picture; bigger images are averaged down")
      ->capture_default_str()
      ->check(CLI::Range(16, 65536));
  command->callback([o] {
    catch_interrupts();
    report(*o);
  });
}

}  // namespace lumicut::tools
