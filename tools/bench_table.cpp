#include "tools/bench_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <set>

namespace lumicut::tools {

using nlohmann::ordered_json;

namespace {

using Rows = std::vector<const ordered_json*>;

// In the order in which they first appear.
std::vector<std::string> names(const Rows& rows, const char* key) {
  std::vector<std::string> out;
  for (const ordered_json* row : rows) {
    const std::string name = (*row).at(key).get<std::string>();
    if (std::find(out.begin(), out.end(), name) == out.end()) out.push_back(name);
  }
  return out;
}

std::vector<int64_t> numbers(const Rows& rows, const char* key) {
  std::set<int64_t> all;
  for (const ordered_json* row : rows) all.insert((*row).at(key).get<int64_t>());
  return {all.begin(), all.end()};
}

Rows where(const Rows& rows, const std::function<bool(const ordered_json&)>& holds) {
  Rows out;
  for (const ordered_json* row : rows)
    if (holds(*row)) out.push_back(row);
  return out;
}
Rows where_text(const Rows& rows, const char* key, const std::string& value) {
  return where(rows, [&](const ordered_json& row) { return row.at(key) == value; });
}
Rows where_number(const Rows& rows, const char* key, int64_t value) {
  return where(rows, [&](const ordered_json& row) { return row.at(key) == value; });
}

struct Line {
  const char* label;
  const char* key;
  double factor;
  const char* format;
};

// "key" or "object/key".
const ordered_json* find(const ordered_json& row, const std::string& key) {
  const size_t slash = key.find('/');
  if (slash == std::string::npos) return row.contains(key) ? &row[key] : nullptr;
  const auto object = row.find(key.substr(0, slash));
  return object != row.end() && object->contains(key.substr(slash + 1)) ? &(*object)[key.substr(slash + 1)] : nullptr;
}

std::string cell(const Rows& rows, const Line& line) {
  double mean = 0;
  if (!mean_of(rows, line.key, mean)) return "-";
  return fmt::format(fmt::runtime(line.format), mean * line.factor);
}

// "" when all are 0 or absent.
bool anything(const Rows& rows, const Line& line) {
  double mean = 0;
  return mean_of(rows, line.key, mean) && mean != 0;
}

std::string percent_parameters(const ordered_json& row) {
  std::string text;
  for (const auto& [name, value] : row.at("given_parameters").items())
    text += (text.empty() ? "" : ", ") + name + "=" + value.get<std::string>();
  return text;
}

// What a matched run was matched to, and how.
std::string match_text(const Rows& rows) {
  const auto found = std::find_if(rows.begin(), rows.end(), [](const auto* row) { return row->contains("match"); });
  if (found == rows.end()) return "";
  const ordered_json& m = (**found).at("match");
  return fmt::format(
      "; {} varied until {} is that of {}", m.at("vary").get<std::string>(), m.at("measure").get<std::string>(),
      m.contains("run") ? m.at("run").get<std::string>() : fmt::format("{}", m.at("target").get<double>()));
}

std::string matched_value(const Rows& rows) {
  double mean = 0;
  if (!mean_of(rows, "match/value", mean)) return "-";
  const bool all =
      std::all_of(rows.begin(), rows.end(), [](const auto* r) { return (*r).at("match").at("matched") == true; });
  return fmt::format("{:.4g}{}", mean, all ? "" : " (nearest)");
}

constexpr Line kRender = {"Render (s)", "render_seconds", 1, "{:.2f}"};
constexpr Line kLines[] = {
    {"Preprocessing (s)", "preprocess_seconds", 1, "{:.2f}"},
    kRender,
    {"Rays a pixel", "rays_per_pixel", 1, "{:.0f}"},
    {"Bounds a pixel", "bounds_per_pixel", 1, "{:.0f}"},
    {"Clusters a pixel", "clusters_per_pixel", 1, "{:.0f}"},
    {"RMSE / mean", "rmse", 1, "{:.5f}"},
    {"RMSE in [0,1]", "rmse_display", 1, "{:.5f}"},
    {"LMSE", "lmse", 1, "{:.3g}"},
    {"Rel. error (%)", "mean_relative_error", 100, "{:.3f}"},
    {"Rel. error p95 (%)", "p95_relative_error", 100, "{:.2f}"},
    {"Rel. error p99 (%)", "p99_relative_error", 100, "{:.2f}"},
    {"Rel. error max (%)", "max_relative_error", 100, "{:.1f}"},
    {"Peak memory (MB)", "peak_bytes", 1e-6, "{:.0f}"},
    {"Speed-up on exhaustive", "speedup/render_on_exhaustive", 1, "{:.1f}"},
    {"  with preprocessing", "speedup/total_on_exhaustive", 1, "{:.1f}"},
    {"Speed-up on the baseline", "speedup/render_on_baseline", 1, "{:.2f}"},
    {"  with preprocessing", "speedup/total_on_baseline", 1, "{:.2f}"},
};

Table method_table(const ordered_json& results, const Rows& rows, const std::string& title) {
  Table table;
  table.title = title;
  const auto scenes = names(rows, "scene");
  table.header = {""};
  table.header.insert(table.header.end(), scenes.begin(), scenes.end());
  std::vector<Rows> columns;
  for (const auto& scene : scenes) columns.push_back(where_text(rows, "scene", scene));
  const auto add = [&](const std::string& label, const std::function<std::string(const Rows&)>& value) {
    std::vector<std::string> line = {label};
    for (const Rows& column : columns) line.push_back(value(column));
    table.rows.push_back(line);
  };
  const auto first = [](const Rows& column, const char* key) { return (*column[0]).at(key).get<int64_t>(); };
  add("Triangles", [&](const Rows& c) { return std::to_string(first(c, "triangles")); });
  add("VPLs", [&](const Rows& c) { return std::to_string(first(c, "vpls")); });
  add("Image", [&](const Rows& c) { return fmt::format("{}x{}", first(c, "width"), first(c, "height")); });
  const int views = results.value("amortise_views", 1);
  for (const auto& run : names(rows, "run")) {
    const Rows all = where_text(rows, "run", run);
    const std::string parameters = percent_parameters(*all[0]);
    table.rows.push_back({fmt::format("{} ({}{}{})", run, (*all[0]).at("integrator").get<std::string>(),
                                      parameters.empty() ? "" : ", " + parameters, match_text(all))});
    const auto line = [&](const Line& what) {
      if (!anything(all, what)) return;
      add(what.label, [&](const Rows& c) { return cell(where_text(c, "run", run), what); });
    };
    if (all[0]->contains("match"))
      add((*all[0]).at("match").at("vary").get<std::string>() + " found",
          [&](const Rows& c) { return matched_value(where_text(c, "run", run)); });
    for (const Line& what : kLines) {
      line(what);
      if (std::string_view(what.key) == kRender.key && views > 1) {
        const std::string label = fmt::format("Seconds a view, over {}", views);
        line({label.c_str(), "amortised_seconds", 1, "{:.2f}"});
      }
    }
  }
  return table;
}

// Rows a method, columns numbers of lights.
Table scaling_table(const Rows& rows, const std::string& title, const Line& what, bool slope) {
  Table table;
  table.title = title;
  const auto counts = numbers(rows, "vpls_requested");
  table.header = {"VPLs"};
  for (const int64_t count : counts) table.header.push_back(std::to_string(count));
  if (slope) table.header.push_back("grows as n^");
  for (const auto& run : names(rows, "run")) {
    const Rows all = where_text(rows, "run", run);
    std::vector<std::string> line = {run};
    std::vector<std::pair<double, double>> points;
    for (const int64_t count : counts) {
      const Rows here = where_number(all, "vpls_requested", count);
      line.push_back(cell(here, what));
      double mean = 0;
      if (mean_of(here, what.key, mean) && mean > 0) points.emplace_back(static_cast<double>(count), mean);
    }
    if (slope)
      line.push_back(points.size() < 2 ? "-"
                                       : fmt::format("{:.2f}", std::log(points.back().second / points[0].second) /
                                                                   std::log(points.back().first / points[0].first)));
    table.rows.push_back(line);
  }
  return table;
}

// Characters, not bytes: names may be in any language.
size_t width_of(const std::string& text) {
  return static_cast<size_t>(std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xc0) != 0x80; }));
}

std::string join(const std::vector<std::string>& cells, const std::vector<size_t>& widths, const char* between,
                 bool left_first) {
  std::string line;
  for (size_t i = 0; i < cells.size(); ++i) {
    const std::string gap(widths[i] - std::min(widths[i], width_of(cells[i])), ' ');
    line += (i == 0 ? "" : between) + (i == 0 && left_first ? cells[i] + gap : gap + cells[i]);
  }
  return line;
}

std::string escaped(const std::string& cell) {
  std::string out;
  for (const char c : cell) out += c == '|' ? "\\|" : std::string(1, c);
  return out;
}

}  // namespace

bool mean_of(const Rows& rows, const std::string& key, double& mean) {
  double sum = 0, count = 0;
  for (const ordered_json* row : rows) {
    const ordered_json* value = find(*row, key);
    if (value != nullptr && value->is_number()) sum += value->get<double>(), ++count;
  }
  if (count > 0) mean = sum / count;
  return count > 0;
}

Rows complete_rows(const ordered_json& results) {
  Rows rows;
  for (const auto& row : results.at("rows"))
    if (!row.contains("failed")) rows.push_back(&row);
  return rows;
}

std::vector<Table> bench_tables(const ordered_json& results) {
  std::vector<Table> tables;
  const Rows rows = complete_rows(results);
  const size_t seeds = numbers(rows, "seed").size();
  const auto note = [&](Table table, bool speed_ups = false) {
    if (seeds > 1) table.note = fmt::format("Means over {} seeds. ", seeds);
    if (speed_ups && !results.value("baseline", "").empty())
      table.note += fmt::format("The baseline is {}. ", results.at("baseline").get<std::string>());
    tables.push_back(std::move(table));
  };
  for (const int64_t samples : numbers(rows, "samples")) {
    const Rows of_samples = where_number(rows, "samples", samples);
    const std::string spp = fmt::format("{} sample{} a pixel", samples, samples == 1 ? "" : "s");
    for (const int64_t vpls : numbers(of_samples, "vpls_requested"))
      note(method_table(results, where_number(of_samples, "vpls_requested", vpls),
                        spp + (vpls > 0 ? fmt::format(", {} VPLs", vpls) : ", VPLs of a file")),
           true);
    for (const auto& scene : names(of_samples, "scene")) {
      const Rows here = where_text(of_samples, "scene", scene);
      if (numbers(here, "vpls_requested").size() < 2) continue;
      const std::string tail = " by number of VPLs: " + scene + ", " + spp;
      note(scaling_table(here, "Render seconds" + tail, kRender, true));
      note(scaling_table(here, "Seconds, everything counted," + tail, {"", "total_seconds", 1, "{:.2f}"}, true));
      note(scaling_table(here, "Peak memory (GB)" + tail, {"", "peak_bytes", 1e-9, "{:.2f}"}, false));
      note(scaling_table(here, "Relative error (%)" + tail, {"", "mean_relative_error", 100, "{:.3f}"}, false));
    }
  }
  return tables;
}

std::string to_text(const std::vector<Table>& tables) {
  std::string out;
  for (const Table& table : tables) {
    std::vector<size_t> widths(table.header.size(), 0);
    for (size_t i = 0; i < widths.size(); ++i) {
      widths[i] = width_of(table.header[i]);
      for (const auto& row : table.rows)
        if (row.size() == widths.size()) widths[i] = std::max(widths[i], width_of(row[i]));
    }
    out += table.title + "\n" + std::string(width_of(table.title), '=') + "\n" +
           join(table.header, widths, "  ", true) + "\n";
    for (const auto& row : table.rows)
      out += row.size() == 1 ? "\n" + row[0] + "\n" : join(row, widths, "  ", true) + "\n";
    out += (table.note.empty() ? "" : table.note + "\n") + "\n";
  }
  return out;
}

std::string to_markdown(const std::vector<Table>& tables) {
  std::string out;
  for (const Table& table : tables) {
    out += "### " + table.title + "\n\n|";
    for (const auto& cell : table.header) out += " " + escaped(cell) + " |";
    out += "\n|---|";
    for (size_t i = 1; i < table.header.size(); ++i) out += "---:|";
    out += "\n";
    for (const auto& row : table.rows) {
      out += "|";
      for (size_t i = 0; i < table.header.size(); ++i)
        out += i >= row.size()   ? " |"
               : row.size() == 1 ? " **" + escaped(row[0]) + "** |"
                                 : " " + escaped(row[i]) + " |";
      out += "\n";
    }
    out += "\n" + (table.note.empty() ? "" : table.note + "\n\n");
  }
  return out;
}

}  // namespace lumicut::tools
