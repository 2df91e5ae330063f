// lumicut bench: scenes x integrators x parameters x numbers of lights x seeds -> results.json and tables. What a plan
// and the results hold: docs/benchmarking.md. Every run is `lumicut render` in a process of its own.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>

#include "film/metrics.h"
#include "io/atomic_file.h"
#include "io/file_error.h"
#include "io/image_file.h"
#include "io/json_reader.h"
#include "tools/bench_machine.h"
#include "tools/bench_plan.h"
#include "tools/bench_references.h"
#include "tools/bench_table.h"
#include "tools/commands.h"
#include "tools/progress_bar.h"
#include "tools/render_setup.h"

namespace lumicut::tools {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

namespace {

constexpr char kFormat[] = "lumicut-bench/1";

struct Options {
  std::string plan, output = "out/bench", size, accel;
  std::vector<std::string> scenes, runs, only;
  std::vector<int64_t> vpls, seeds, samples;
  int threads = -1, repeat = 0;
  int64_t squares = -1;
  bool resume = false, overwrite = false, quiet = false, check = false, strict = false;
};

double now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const size_t n = values.size();
  return n == 0 ? 0 : n % 2 == 1 ? values[n / 2] : (values[n / 2 - 1] + values[n / 2]) / 2;
}

// "lightcuts error=0.02" -> {"name": itself, "integrator": "lightcuts", "parameters": {"error": "0.02"}}.
ordered_json run_of_text(const std::string& text) {
  std::stringstream words(text);
  ordered_json run = {{"name", text}};
  for (std::string word; words >> word;) {
    const size_t equals = word.find('=');
    if (!run.contains("integrator")) {
      run["integrator"] = word;
    } else if (equals == std::string::npos || equals == 0) {
      throw UsageError(fmt::format("--run \"{}\": must be an integrator and name=value pairs", text));
    } else {
      run["parameters"][word.substr(0, equals)] = word.substr(equals + 1);
    }
  }
  if (!run.contains("integrator")) throw UsageError("--run: is empty");
  return run;
}

// What a run is, for comparing what stands with what is asked for.
ordered_json job_of(const BenchGroup& group, const BenchRun& run, const std::string& lights_hash) {
  ordered_json job = {{"arguments", group.arguments()},
                      {"lights", lights_hash},
                      {"integrator", run.integrator},
                      {"parameters", run.parameters}};
  if (run.match) {
    const BenchMatch& m = *run.match;
    job["match"] = {m.measure, m.run,   m.target,          m.vary,      m.low,
                    m.high,    m.start, m.finer_is_larger, m.tolerance, m.steps};
  }
  return job;
}

// One run of a method: what `render` said of it, and its distance from the reference.
struct Trial {  // NOLINT(bugprone-exception-escape): nlohmann declares its moves noexcept
  RenderStats stats;
  Metrics metrics;
  double render_seconds() const { return stats["phases"].value("render", 0.0); }
  double preprocess_seconds() const { return stats["seconds"].get<double>() - render_seconds(); }
};

void set_errors(ordered_json& row, const Metrics& m) {
  row["rmse"] = m.rmse;
  row["rmse_display"] = m.rmse_display;
  row["lmse"] = m.lmse;
  row["mean_relative_error"] = m.mean_relative_error;
  row["p95_relative_error"] = m.p95_relative_error;
  row["p99_relative_error"] = m.p99_relative_error;
  row["max_relative_error"] = m.max_relative_error;
  row["mrse"] = m.mrse;
  row["bias"] = m.bias;
  row["compared_pixels"] = m.pixels;
}

class BenchCommand {
 public:
  explicit BenchCommand(const Options& options) : o_(options), bar_(options.quiet) {}

  void run() try {
    read_plan();
    if (o_.check) {
      fmt::print("{}: {} scenes, {} runs: good\n", plan_.file, plan_.scenes.size(), plan_.runs.size());
      return;
    }
    open_output();
    plan_groups();
    try {
      for (BenchGroup& group : groups_) run_group(group);
    } catch (const Interrupted&) {
      bar_.wipe();
      write_tables();
      print_error("lumicut: interrupted; {} rows stand in {}; go on with --resume\n",
                  results_["rows"].size() + old_rows_.size(), results_file());
      throw SilentExit(kInterrupted);
    }
    bar_.wipe();
    old_rows_.clear();  // what no run of this plan took
    write_tables();
    if (!o_.quiet) fmt::print("{}", to_text(bench_tables(results_)));
    if (!o_.quiet) fmt::print("{}: {} rows; tables beside it\n", results_file(), results_["rows"].size());
    const auto failed = std::count_if(results_["rows"].begin(), results_["rows"].end(),
                                      [](const auto& row) { return row.contains("failed"); });
    if (failed > 0) throw std::runtime_error(fmt::format("bench: {} runs failed", failed));
  } catch (const io::FileError& error) {
    throw io::FileError(plan_.variables.hide(error.what()));
  }

 private:
  const io::Api& api() const { return library_.api(); }
  std::string results_file() const { return (fs::path(o_.output) / "results.json").string(); }
  std::string in_output(const std::string& name) const { return (fs::path(o_.output) / name).string(); }

  void say(const std::string& text) {
    bar_.wipe();
    if (!o_.quiet) print_error("{}\n", plan_.variables.hide(text));
  }

  // ---- What to run ----

  void read_plan() {
    if (o_.plan.empty() == (o_.scenes.empty() && o_.runs.empty()))
      throw UsageError("bench: give a plan (JSON), or --scene and --run, not both");
    if (o_.plan.empty()) {
      for (const auto& scene : o_.scenes)
        if (io::json_text(ordered_json(scene)) !=
            ordered_json(scene).dump(-1, ' ', false, ordered_json::error_handler_t::ignore))
          throw UsageError(fmt::format("--scene {}: the results are JSON, which holds paths in UTF-8 alone", scene));
      ordered_json plan = {{"name", "command line"}, {"scenes", o_.scenes}, {"runs", ordered_json::array()}};
      for (const auto& run : o_.runs) plan["runs"].push_back(run_of_text(run));
      plan_ = parse_bench_plan(io::json_text(plan), "command line", "", api());
    } else {
      plan_ = read_bench_plan(o_.plan, api());
    }
    plan_.strict = o_.strict;
    if (o_.threads >= 0) plan_.threads = o_.threads;
    if (!o_.accel.empty()) plan_.accel = o_.accel;
    if (o_.repeat > 0) plan_.repeat = o_.repeat;
    std::vector<uint32_t> size;
    if (!o_.size.empty()) size = image_size(o_.size);
    std::vector<std::string> names;
    for (const BenchScene& scene : plan_.scenes) names.push_back(scene.name);
    for (const auto& name : o_.only)
      if (std::find(names.begin(), names.end(), name) == names.end())
        throw UsageError(
            fmt::format("--only {}: the plan has no scene of that name; it has {}", name, fmt::join(names, ", ")));
    if (!o_.only.empty())
      std::erase_if(plan_.scenes,
                    [&](const auto& s) { return std::find(o_.only.begin(), o_.only.end(), s.name) == o_.only.end(); });
    for (BenchScene& scene : plan_.scenes) {
      const bool fixed = !scene.reference.empty();
      if (!size.empty() && !fixed) scene.size = size;
      if (!o_.samples.empty() && !fixed) scene.samples = o_.samples;
      if (!o_.vpls.empty() && scene.vpl_file.empty() && !fixed) scene.vpls = o_.vpls;
      if (!o_.seeds.empty() && !fixed) scene.seeds = o_.seeds;
      if (o_.squares >= 0) scene.squares = static_cast<uint32_t>(o_.squares);
    }
  }

  void open_output() {
    std::error_code code;
    for (const char* folder : {"", "references", "images"}) fs::create_directories(in_output(folder), code);
    if (!fs::is_directory(in_output("images"), code))
      throw io::FileError(o_.output, "is no folder, and cannot be made one");
    const bool stands = fs::exists(results_file(), code);
    if (stands && !o_.resume && !o_.overwrite)
      throw UsageError(
          fmt::format("{} stands already: --resume goes on with it, --overwrite begins anew", results_file()));
    io::check_writable(results_file());
    results_ = {{"format", kFormat},
                {"name", plan_.name},
                {"description", plan_.description},
                {"plan", plan_.file},
                {"version", api().version(nullptr, nullptr)},
                {"git", git_description()},
                {"machine", describe_machine()},
                {"threads", plan_.threads},
                {"accel", plan_.accel},
                {"rays", plan_.rays},
                {"repeat", plan_.repeat},
                {"baseline", plan_.baseline},
                {"amortise_views", plan_.amortise_views},
                {"yardsticks", ordered_json::array()},
                {"skipped", ordered_json::array()},
                {"references", ordered_json::array()},
                {"rows", ordered_json::array()}};
    if (!stands || !o_.resume) return;
    const auto old = io::parse_json<ordered_json>(io::read_whole_file(results_file()), results_file());
    try {
      if (old.at("format") != kFormat || !old.at("rows").is_array())
        throw io::FileError(results_file(), fmt::format("is no {} to go on with", kFormat));
      // Rows of another library or machine are no part of this table: ratios between them would mean nothing.
      if (old.at("git") != results_["git"] || old.at("machine").at("processor") != results_["machine"]["processor"]) {
        say(fmt::format("{} is of another version or machine: all runs begin anew", results_file()));
        return;
      }
      for (const auto& row : old.at("rows"))
        if (whole_row(row)) old_rows_.push_back(row);
      for (const auto& entry : old.at("yardsticks"))
        if (entry.at("scene").is_string() && entry.at("mray_per_second").is_number())
          results_["yardsticks"].push_back(entry);
    } catch (const nlohmann::json::exception& error) {
      throw io::FileError(results_file(), fmt::format("lacks what going on needs: {}", error.what()));
    }
  }

  // One that an earlier run has ended: what later rows are held against is there.
  static bool whole_row(const ordered_json& row) {
    if (!row.is_object() || !row.contains("job") || row.contains("failed")) return false;
    const auto number = [&](const char* key) { return row.contains(key) && row[key].is_number(); };
    return row.contains("run") && row["run"].is_string() && row.contains("seconds_each") && number("render_seconds") &&
           number("preprocess_seconds") && number("total_seconds") && number("amortised_seconds");
  }

  void plan_groups() {
    for (const BenchScene& scene : plan_.scenes) {
      if (!scene.absent.empty()) {
        skip(scene, scene.absent);
        continue;
      }
      const std::vector<int64_t> samples = scene.samples.empty() ? std::vector<int64_t>{0} : scene.samples;
      for (const int64_t spp : samples)
        for (const int64_t vpls : scene.vpls)
          for (const int64_t seed : scene.seeds) groups_.push_back({&plan_, &scene, spp, vpls, seed});
    }
    total_ = groups_.size() * plan_.runs.size() * static_cast<size_t>(plan_.repeat);
  }

  void skip(const BenchScene& scene, const std::string& why) {
    say(fmt::format("{}: skipped: {}", scene.name, why));
    results_["skipped"].push_back({{"scene", scene.name}, {"why", plan_.variables.hide(why)}});
    skipped_.push_back(scene.name);
  }

  // ---- Groups ----

  void run_group(const BenchGroup& group) {
    if (std::find(skipped_.begin(), skipped_.end(), group.scene->name) != skipped_.end()) return;
    std::string hash;
    try {
      hash = hash_lights(group);
    } catch (const io::FileError& error) {
      if (!group.scene->optional) throw;
      skip(*group.scene, error.what());
      return;
    }
    yardstick(group);
    const BenchReference reference = get_reference(
        group, o_.output, hash, [this](const std::string& text) { label_ = text, began_ = now(), say(text + " ..."); },
        [this] { tick(); });
    results_["references"].push_back(reference.info);
    const size_t first = results_["rows"].size();
    // Repetitions go around all methods, so that a load which comes and goes hits them alike.
    for (int repetition = 0; repetition < plan_.repeat; ++repetition)
      for (size_t r = 0; r < plan_.runs.size(); ++r) {
        stop_if_interrupted();
        if (repetition == 0) results_["rows"].push_back(old_row(job_of(group, plan_.runs[r], hash)));
        ordered_json& row = results_["rows"][first + r];
        const size_t have = row.contains("seconds_each") ? row["seconds_each"].size() : 0;
        ++started_;
        if (row.contains("failed") || have > static_cast<size_t>(repetition)) continue;
        try {
          run_row(group, plan_.runs[r], reference, first, row);
        } catch (const Interrupted&) {
          if (row.empty() || !row.contains("seconds_each")) results_["rows"].erase(first + r);
          relate(first, reference);
          save();
          throw;
        } catch (const std::bad_alloc&) {
          throw;
        } catch (const std::exception& error) {
          describe(group, plan_.runs[r], row);
          row["failed"] = plan_.variables.hide(error.what());
          say(fmt::format("{}, {}: failed: {}", group.name(), plan_.runs[r].name, error.what()));
        }
        row["job"] = job_of(group, plan_.runs[r], hash);
        relate(first, reference);
        save();
      }
    relate(first, reference);
    save();
  }

  // Takes the row of an earlier run out of those that wait, or gives {}.
  ordered_json old_row(const ordered_json& job) {
    for (auto row = old_rows_.begin(); row != old_rows_.end(); ++row)
      if (row->is_object() && row->contains("job") && (*row)["job"] == job && !row->contains("failed")) {
        ordered_json taken = std::move(*row);
        old_rows_.erase(row);
        return taken;
      }
    return ordered_json::object();
  }

  // Traces the group's lights and reads its scene: what cannot be read fails here.
  std::string hash_lights(const BenchGroup& group) {
    const std::string lights = in_output("." + group.name() + ".vpl");
    std::vector<std::string> arguments = group.arguments();
    for (size_t i = 0; i + 1 < arguments.size();)
      if (arguments[i] == "--size" || arguments[i] == "--spp") {
        arguments.erase(arguments.begin() + static_cast<std::ptrdiff_t>(i),
                        arguments.begin() + static_cast<std::ptrdiff_t>(i) + 2);
      } else {
        ++i;
      }
    arguments.insert(arguments.end(), {"--size", "1x1", "--spp", "1", "-i", "exhaustive", "--vpl-out", lights});
    label_ = "lights of " + group.name(), began_ = now();
    render_in_child(arguments, in_output(".stats.json"), [this] { tick(); });
    std::string hash = file_hash(lights);
    std::error_code code;
    fs::remove(lights, code);
    return hash;
  }

  void yardstick(const BenchGroup& group) {
    if (!plan_.yardstick) return;
    for (const auto& known : results_["yardsticks"])
      if (known["scene"] == group.scene->name) return;
    ordered_json entry = {{"scene", group.scene->name}};
    entry.update(measure_yardstick(api(), group.scene->file, plan_.threads));
    say(fmt::format("{}: yardstick: {:.2f} Mray/s, {:.0f} % occluded", group.scene->name,
                    entry["mray_per_second"].get<double>(), 100 * entry["occluded"].get<double>()));
    results_["yardsticks"].push_back(entry);
  }

  // ---- Runs ----

  Trial run_once(const BenchGroup& group, const BenchRun& run, const Parameters& parameters,
                 const BenchReference& reference, const std::string& image_file, bool measure) {
    std::vector<std::string> arguments = group.arguments();
    arguments.insert(arguments.end(), {"-i", run.integrator});
    for (const auto& [name, value] : parameters) arguments.insert(arguments.end(), {"-p", name + "=" + value});
    if (measure) arguments.insert(arguments.end(), {"-o", image_file, "--layers", "radiance,cut_size,rays,bounds"});
    Trial trial;
    trial.stats = render_in_child(arguments, in_output(".stats.json"), [this] { tick(); });
    if (!measure) return trial;
    const io::Image image = io::read_image(image_file);
    const auto& pixels = image.find("radiance")->pixels;
    MetricOptions options;
    options.flip = false;
    if (group.scene->ignore_above > 0) options.ignore_above = static_cast<float>(group.scene->ignore_above);
    const RgbImage a{pixels, static_cast<uint32_t>(image.width), static_cast<uint32_t>(image.height)};
    if (a.width != reference.width || a.height != reference.height)
      throw std::runtime_error(fmt::format("the image has {} x {} pixels, the reference {} x {}", a.width, a.height,
                                           reference.width, reference.height));
    trial.metrics = compare_images(a, {reference.pixels, reference.width, reference.height}, options);
    return trial;
  }

  void run_row(const BenchGroup& group, const BenchRun& run, const BenchReference& reference, size_t first,
               ordered_json& row) {
    label_ = fmt::format("{}, {}", group.name(), run.name), began_ = now();
    const std::string image = "images/" + group.name() + "." + file_name_of(run.name) + ".exr";
    const bool new_row = !row.contains("seconds_each");
    Parameters parameters = run.parameters;
    if (!new_row && run.match) parameters[run.match->vary] = row["match"]["text"].get<std::string>();
    Trial trial;
    if (new_row && run.match) {
      ordered_json match;
      trial = search(group, run, reference, first, in_output(image), match);
      describe(group, run, row);
      row["match"] = match;
      parameters[run.match->vary] = match["text"].get<std::string>();
    } else {
      trial = run_once(group, run, parameters, reference, in_output(image), new_row);
      if (new_row) describe(group, run, row);
    }
    if (new_row) fill(row, group, run, parameters, trial, reference, image);
    const uint64_t peak = trial.stats["peak_bytes"].get<uint64_t>();
    row["peak_bytes"] = std::max(peak, row.value("peak_bytes", uint64_t{0}));
    // The counts of one image are the same in every run; if not, the row says so.
    if (row["counters"] != trial.stats["counters"]) row["counts_vary"] = true;
    row["seconds_each"].push_back({{"preprocess", trial.preprocess_seconds()}, {"render", trial.render_seconds()}});
    std::vector<double> preprocess, render;
    for (const auto& one : row["seconds_each"]) {
      preprocess.push_back(one["preprocess"].get<double>());
      render.push_back(one["render"].get<double>());
    }
    const double p = median(preprocess), r = median(render);
    row["preprocess_seconds"] = p, row["render_seconds"] = r, row["total_seconds"] = p + r;
    row["amortised_seconds"] = p / plan_.amortise_views + r;
    say(fmt::format("[{}/{}] {}: {:.2f} s, RMSE {:.5f}, error {:.3f} %{}", started_, total_, label_, p + r,
                    row["rmse"].get<double>(), 100 * row["mean_relative_error"].get<double>(),
                    row.contains("match")
                        ? fmt::format(", {}={}{}", run.match->vary, row["match"]["text"].get<std::string>(),
                                      row["match"]["matched"].get<bool>() ? "" : " (nearest)")
                        : ""));
  }

  // Before a run: what it is.
  void describe(const BenchGroup& group, const BenchRun& run, ordered_json& row) const {
    row["scene"] = group.scene->name;
    row["run"] = run.name;
    row["integrator"] = run.integrator;
    row["given_parameters"] = run.parameters;
    row["group"] = group.name();
    row["scene_file"] = group.scene->file;
    row["vpls_requested"] = group.vpls;
    row["seed"] = group.seed;
  }

  // After its first: all that does not change with repetition.
  void fill(ordered_json& row, const BenchGroup& group, const BenchRun& run, const Parameters& parameters,
            const Trial& trial, const BenchReference& reference, const std::string& image) {
    std::vector<std::string> arguments = group.arguments();
    arguments.insert(arguments.end(), {"-i", run.integrator});
    for (const auto& [name, value] : parameters) arguments.insert(arguments.end(), {"-p", name + "=" + value});
    row["command"] = fmt::format("lumicut {}", fmt::join(arguments, " "));
    for (const char* key :
         {"parameters", "vpls", "width", "height", "samples", "accel", "robust", "threads", "triangles",
          "rays_per_pixel", "bounds_per_pixel", "clusters_per_pixel", "phases", "counters", "version"})
      row[key] = trial.stats[key];
    row["git"] = results_["git"];
    set_errors(row, trial.metrics);
    if (reference.info.contains("file")) row["reference"] = reference.info["file"];
    if (group.scene->ignore_above > 0) row["ignore_above"] = group.scene->ignore_above;
    if (plan_.keep_images) {
      row["image"] = image;
    } else {
      std::error_code code;
      fs::remove(in_output(image), code);
    }
    row["seconds_each"] = ordered_json::array();
  }

  double measured(const Trial& trial, const std::string& measure) const {
    ordered_json row;
    set_errors(row, trial.metrics);
    row["render_seconds"] = trial.render_seconds();
    row["total_seconds"] = trial.stats["seconds"];
    return row[measure].get<double>();
  }

  // Varies the run's parameter until the measure meets its target: both on logarithmic scales, where they are nearly
  // straight lines; false position within the bracket, kept off its ends, halving what it holds at least by a tenth.
  Trial search(const BenchGroup& group, const BenchRun& run, const BenchReference& reference, size_t first,
               const std::string& image, ordered_json& match) {
    const BenchMatch& m = *run.match;
    double target = m.target;
    if (!m.run.empty()) {
      const ordered_json* other = nullptr;
      for (size_t i = first; i < results_["rows"].size(); ++i)
        if (results_["rows"][i].value("run", "") == m.run && results_["rows"][i].contains("seconds_each"))
          other = &results_["rows"][i];
      if (other == nullptr) throw std::runtime_error(fmt::format("the run to match, {}, has no result", m.run));
      if (!other->contains(m.measure) || !(*other)[m.measure].is_number())
        throw std::runtime_error(fmt::format("the run to match, {}, has no {}", m.run, m.measure));
      target = (*other)[m.measure].get<double>();
      if (!(target > 0)) throw std::runtime_error(fmt::format("{} of the run to match is 0", m.measure));
    }
    match = {{"measure", m.measure}, {"vary", m.vary}, {"target", target}, {"tolerance", m.tolerance}};
    if (!m.run.empty()) match["run"] = m.run;
    match["matched"] = false;
    match["steps"] = ordered_json::array();
    struct End {
      double x, off;
    };
    std::optional<End> low, high;  // off < 0 and > 0 times the slope's sign
    const double slope = m.of_time() == m.finer_is_larger ? 1 : -1;
    double x = std::log(m.start), best_off = std::numeric_limits<double>::infinity();
    const double x_low = std::log(m.low), x_high = std::log(m.high);
    const std::string trial_image = image + ".trial.exr";
    const std::string name = label_;
    Trial best;
    std::vector<std::string> tried;
    for (int step = 0; step < m.steps; ++step) {
      const double value = m.integer ? std::round(std::exp(x)) : std::exp(x);
      const std::string text = fmt::format("{:.6g}", value);
      if (std::find(tried.begin(), tried.end(), text) != tried.end()) break;  // whole numbers between are used up
      tried.push_back(text);
      Parameters parameters = run.parameters;
      parameters[m.vary] = text;
      label_ = fmt::format("{}, {}={}", name, m.vary, text);
      const Trial trial = run_once(group, run, parameters, reference, trial_image, true);
      const double at = measured(trial, m.measure);
      match["steps"].push_back({{"value", value},
                                {"measured", at},
                                {"rmse", trial.metrics.rmse},
                                {"mean_relative_error", trial.metrics.mean_relative_error},
                                {"render_seconds", trial.render_seconds()},
                                {"total_seconds", trial.stats["seconds"]}});
      say(fmt::format("    {}={}: {} {:.5g}, wanted {:.5g}", m.vary, text, m.measure, at, target));
      const double off = at > 0 ? std::log(at / target) : -10;
      if (std::abs(off) < best_off) {
        best_off = std::abs(off);
        best = trial;
        match["value"] = value, match["text"] = text, match["reached"] = at;
        fs::rename(trial_image, image);
      }
      if (best_off <= std::log1p(m.tolerance)) {
        match["matched"] = true;
        break;
      }
      (slope * off > 0 ? high : low) = End{x, off};
      if (low && high) {
        const double share = std::clamp(low->off / (low->off - high->off), 0.1, 0.9);
        x = low->x + share * (high->x - low->x);
      } else {
        const double stride = std::clamp(-slope * off, -std::log(8.0), std::log(8.0));
        const double next = x + std::copysign(std::max(std::abs(stride), std::log(1.3)), stride);
        if ((next < x && x <= x_low) || (next > x && x >= x_high)) break;  // out of reach
        x = std::clamp(next, x_low, x_high);
      }
    }
    label_ = name;
    std::error_code code;
    fs::remove(trial_image, code);
    return best;
  }

  bool sums_all_lights(const std::string& integrator) {
    return (integrator_info(api(), integrator).traits & LUMICUT_ALL_LIGHTS) != 0;
  }

  // Speed-ups: on the exhaustive sum and on the baseline, of the same group.
  void relate(size_t first, const BenchReference& reference) {
    const ordered_json *baseline = nullptr, *exhaustive = nullptr;
    ordered_json& rows = results_["rows"];
    for (size_t i = first; i < rows.size(); ++i) {
      if (!rows[i].contains("seconds_each")) continue;
      if (rows[i]["run"] == plan_.baseline) baseline = &rows[i];
      if (sums_all_lights(rows[i]["integrator"].get<std::string>())) exhaustive = &rows[i];
    }
    const auto timed = [&](const char* key) { return reference.info.contains(key) && reference.info[key].is_number(); };
    if (exhaustive == nullptr && timed("render_seconds") && timed("preprocess_seconds")) exhaustive = &reference.info;
    for (size_t i = first; i < rows.size(); ++i) {
      if (!rows[i].contains("seconds_each")) continue;
      ordered_json speedup;
      const double render = rows[i]["render_seconds"].get<double>(), total = rows[i]["total_seconds"].get<double>(),
                   amortised = rows[i]["amortised_seconds"].get<double>();
      const auto on = [&](const ordered_json* other, const std::string& name) {
        if (other == nullptr || !(render > 0)) return;
        const double r = (*other)["render_seconds"].get<double>(), p = (*other)["preprocess_seconds"].get<double>();
        speedup["render_on_" + name] = r / render;
        speedup["total_on_" + name] = (r + p) / total;
        speedup["amortised_on_" + name] = (r + p / plan_.amortise_views) / amortised;
      };
      on(exhaustive, "exhaustive");
      on(baseline, "baseline");
      rows[i]["speedup"] = speedup;
    }
  }

  // ---- Files ----

  // With the earlier rows that are not taken yet: another stop must not lose them.
  void save() {
    ordered_json all = results_;
    for (const auto& row : old_rows_) all["rows"].push_back(row);
    io::write_whole_file(results_file(), io::json_text(all, 1) + "\n");
  }

  void write_tables() {
    save();
    const auto tables = bench_tables(results_);
    io::write_whole_file(in_output("tables.txt"), to_text(tables));
    io::write_whole_file(in_output("tables.md"), to_markdown(tables));
  }

  void tick() {
    bar_.show(label_,
              total_ > 0 ? static_cast<double>(started_ > 0 ? started_ - 1 : 0) / static_cast<double>(total_) : 0,
              now() - began_);
  }

  const Options& o_;
  io::Library library_;
  ProgressBar bar_;
  BenchPlan plan_;
  std::vector<BenchGroup> groups_;
  std::vector<std::string> skipped_;
  ordered_json results_, old_rows_ = ordered_json::array();
  std::string label_;
  double began_ = 0;
  size_t started_ = 0, total_ = 0;
};

}  // namespace

void add_bench(CLI::App& app) {
  auto* command = app.add_subcommand("bench", "Run a plan of scenes and methods: times, counts and errors as tables");
  const auto o = std::make_shared<Options>();
  command->add_option("plan", o->plan, "What to run, JSON: docs/benchmarking.md");
  command->add_option("-o,--output", o->output, "Folder for results.json, tables, images and references")
      ->capture_default_str();
  command->add_option("--scene", o->scenes, "Scene to run, in place of a plan; may be repeated")
      ->allow_extra_args(false);
  command->add_option("--run", o->runs, "\"INTEGRATOR name=value ...\" to run, in place of a plan; may be repeated")
      ->allow_extra_args(false);
  command->add_option("--only", o->only, "Of the plan's scenes only this; may be repeated")->allow_extra_args(false);
  command->add_option("--vpls", o->vpls, "Numbers of virtual lights, in place of the plan's")
      ->check(CLI::Range(1, 100000000));
  command->add_option("--seeds", o->seeds, "Seeds, in place of the plan's")
      ->check(CLI::Range(int64_t{0}, int64_t{4294967295}));
  command->add_option("--spp", o->samples, "Samples a pixel, in place of the plan's")->check(CLI::Range(1, 65536));
  command->add_option("--size", o->size, "WIDTHxHEIGHT, in place of the plan's");
  command->add_option("--reference-squares", o->squares, "Squares of 32 pixels that references are rendered on; 0: all")
      ->check(CLI::Range(0, 1 << 24));
  command->add_option("--repeat", o->repeat, "Times that each run is timed; medians are kept")
      ->check(CLI::Range(1, 1000));
  command->add_option("--threads", o->threads, "Threads, in place of the plan's; 0: all")->check(CLI::Range(0, 4096));
  command->add_option("--accel", o->accel, "How rays are traced, in place of the plan's")
      ->check(CLI::IsMember({"bvh", "embree", "agglomerative"}));
  auto* resume = command->add_flag("--resume", o->resume, "Go on with what stands in the folder");
  command->add_flag("--overwrite", o->overwrite, "Begin anew, though results stand in the folder")->excludes(resume);
  command->add_flag("--check", o->check, "Read the plan and say whether it is good; run nothing");
  command->add_flag("--strict", o->strict, "Take what is only warned of in scenes as an error");
  command->add_flag("-q,--quiet", o->quiet, "No progress, and no tables on the terminal");
  command->footer(
      "Example: lumicut bench bench/plans/quick.json -o out/quick && lumicut report out/quick/results.json");
  command->callback([o] {
    catch_interrupts();
    BenchCommand(*o).run();
  });
}

}  // namespace lumicut::tools
