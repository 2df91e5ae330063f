#include "tools/bench_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <set>

#include "io/file_error.h"
#include "io/json_reader.h"
#include "tools/bench_references.h"
#include "tools/render_setup.h"

namespace lumicut::tools {

namespace fs = std::filesystem;
using io::JsonObject;
using io::JsonValue;

namespace {

const std::vector<std::string> kErrorMeasures = {
    "rmse", "rmse_display", "lmse", "mean_relative_error", "p95_relative_error", "p99_relative_error", "mrse"};
constexpr size_t kMaxRuns = 10000, kMaxGroups = 100000;  // far more than anyone waits for
const std::vector<std::string> kTimeMeasures = {"render_seconds", "total_seconds"};

class PlanReader {
 public:
  PlanReader(const std::string& folder, const io::Api& api) : api_(api) {
    plan_.variables = io::PathVariables(folder);
    for (const auto& info : api::integrators(api_)) integrators_.push_back(info.id);
  }

  BenchPlan read(const JsonValue& root) {
    JsonObject top(root);
    plan_.file = root.file();
    plan_.name = top.text("name", fs::path(root.file()).stem().string());
    plan_.description = top.text("description", "");
    plan_.threads = static_cast<int>(top.integer("threads", 0, 0, 4096));
    plan_.repeat = static_cast<int>(top.integer("repeat", 1, 1, 1000));
    plan_.amortise_views = static_cast<int>(top.integer("amortise_views", 10, 1, 1000000));
    plan_.keep_images = top.boolean("keep_images", true);
    plan_.yardstick = top.boolean("yardstick", false);
    if (const auto accel = top.find("accel")) {
      static const std::vector<std::string> kKinds = {"bvh", "embree", "agglomerative"};
      plan_.accel = kKinds[accel->choice(kKinds)];
    }
    if (const auto rays = top.find("rays")) {
      static const std::vector<std::string> kKinds = {"robust", "fast"};
      plan_.rays = kKinds[rays->choice(kKinds)];
    }
    usual_.samples = {}, usual_.vpls = {60000}, usual_.seeds = {1};
    shared(top, usual_);
    const JsonValue scenes = top.need("scenes"), runs = top.need("runs");
    for (const JsonValue& value : scenes.elements()) scene(value);
    if (plan_.scenes.empty()) scenes.fail("holds no scene");
    for (const JsonValue& value : runs.elements()) run(value);
    if (plan_.runs.empty()) runs.fail("holds no run");
    if (const auto baseline = top.find("baseline")) {
      plan_.baseline = baseline->text();
      known_run(*baseline, plan_.baseline);
    } else {
      for (auto r = plan_.runs.rbegin(); r != plan_.runs.rend(); ++r)
        if (r->integrator == kUsualIntegrator) plan_.baseline = r->name;
    }
    top.finish();
    return std::move(plan_);
  }

 private:
  // Keys that stand in a scene, or at the top for all scenes.
  void shared(JsonObject& object, BenchScene& into) {
    if (const auto size = object.find("size")) {
      into.size.clear();
      for (const JsonValue& v : size->elements()) into.size.push_back(static_cast<uint32_t>(v.integer(1, 65536)));
      if (into.size.size() != 2) size->fail_expected("[width, height]");
    }
    counts(object, "samples", 65536, into.samples);
    counts(object, "vpls", 100000000, into.vpls);
    counts(object, "seeds", 4294967295, into.seeds, 0);
    into.squares = static_cast<uint32_t>(object.integer("reference_squares", into.squares, 0, 1 << 24));
    into.ignore_above = object.number("ignore_above", into.ignore_above, 0);
    if (const auto parameters = object.find("parameters")) {
      JsonObject all(*parameters);
      for (const auto& [name, value] : parameters->raw().items()) {
        const JsonValue v = all.need(name);
        if (name == "vpls" || name == "seed")
          v.fail(fmt::format("stands beside \"parameters\", as \"{}\"", name == "seed" ? "seeds" : "vpls"));
        into.parameters[name] = text_of(v);
        check_parameter(v, "exhaustive", name, into.parameters[name]);
      }
    }
  }

  // A whole number or a list of them.
  void counts(JsonObject& object, const std::string& key, int64_t most, std::vector<int64_t>& into, int64_t least = 1) {
    const auto value = object.find(key);
    if (!value) return;
    into.clear();
    std::set<int64_t> known;
    if (!value->raw().is_array()) {
      into.push_back(value->integer(least, most));
      return;
    }
    for (const JsonValue& v : value->elements()) {
      into.push_back(v.integer(least, most));
      if (!known.insert(into.back()).second) v.fail("stands twice");
    }
    if (into.empty()) value->fail("is empty");
  }

  static std::string text_of(const JsonValue& value) {
    if (value.raw().is_string()) return value.text();
    if (value.raw().is_boolean() || value.raw().is_number()) return value.raw().dump();
    value.fail_expected("a number, a text or a truth value");
  }

  // A name that is not set makes the scene absent.
  std::string path_of(const JsonValue& value, std::string& absent) {
    const std::string path = plan_.variables.resolve(value, [&](const std::string& name) {
      absent = fmt::format("the environment variable {} is not set", name);
      return std::string();
    });
    return absent.empty() ? path : "";
  }

  void scene(const JsonValue& value) {
    BenchScene s = usual_;
    if (value.raw().is_string()) {
      s.file = path_of(value, s.absent);
      s.name = fs::path(value.text()).stem().string();
    } else {
      JsonObject object(value);
      const JsonValue file = object.need("file");
      s.file = path_of(file, s.absent);
      s.name = object.text("name", fs::path(file.text()).stem().string());
      s.optional = object.boolean("optional", false);
      shared(object, s);
      if (const auto vpl_file = object.find("vpl_file")) {
        s.vpl_file = path_of(*vpl_file, s.absent);
        if (object.has("vpls")) value.fail("has both \"vpls\" and \"vpl_file\"");
        s.vpls = {0};
      }
      if (const auto reference = object.find("reference")) {
        s.reference = path_of(*reference, s.absent);
        if (s.samples.size() > 1 || s.vpls.size() > 1 || s.seeds.size() > 1)
          value.fail("has one \"reference\", so it may have but one of \"samples\", \"vpls\" and \"seeds\"");
      }
      object.finish();
    }
    if (!scene_names_.insert(file_name_of(s.name)).second)
      value.fail(fmt::format("is another scene called \"{}\": give it a \"name\"", s.name));
    groups_ += std::max<size_t>(s.samples.size(), 1) * s.vpls.size() * s.seeds.size();
    if (groups_ > kMaxGroups)
      value.fail(fmt::format("makes more than {} combinations of \"samples\", \"vpls\" and \"seeds\"", kMaxGroups));
    plan_.scenes.push_back(s);
  }

  // Throws when the library does not take the value.
  void check_parameter(const JsonValue& where, const std::string& integrator, const std::string& name,
                       const std::string& text) {
    io::Handle<lumicut_integrator> handle(api_);
    io::check(api_, api_.integrator_create(device_.get(), integrator.c_str(), handle.out()), integrator);
    if (api_.integrator_set(handle.get(), name.c_str(), text.c_str()) != LUMICUT_OK) where.fail(api_.last_error());
  }

  void known_run(const JsonValue& where, const std::string& name) const {
    if (run_names_.count(name) > 0) return;
    const std::vector<std::string> names(run_names_.begin(), run_names_.end());
    const std::string near = io::nearest_word(name, names);
    where.fail(fmt::format("is \"{}\", but no run before has that name{}", name,
                           near.empty() ? "" : fmt::format("; did you mean \"{}\"?", near)));
  }

  // A list in place of a parameter's value makes a run of each element.
  void run(const JsonValue& value) {
    JsonObject object(value);
    BenchRun r;
    const JsonValue integrator = object.need("integrator");
    r.integrator = integrators_[integrator.choice(integrators_)];
    r.name = object.text("name", r.integrator);
    std::vector<BenchRun> all = {r};
    if (const auto parameters = object.find("parameters")) {
      JsonObject list(*parameters);
      for (const auto& [name, unused] : parameters->raw().items()) {
        const JsonValue v = list.need(name);
        if (name == "vpls" || name == "seed" || is_common(name))
          v.fail("all runs of a scene share it: it stands in the plan or the scene");
        const bool sweep = v.raw().is_array();
        const std::vector<JsonValue> values = sweep ? v.elements() : std::vector<JsonValue>{v};
        if (values.empty()) v.fail("is empty");
        if (values.size() > kMaxRuns / all.size())
          v.fail(fmt::format("makes more than {} runs with the lists beside it", kMaxRuns));
        for (const JsonValue& one : values) check_parameter(one, r.integrator, name, text_of(one));
        std::vector<BenchRun> next;
        for (const BenchRun& base : all)
          for (const JsonValue& one : values) {
            next.push_back(base);
            const std::string text = text_of(one);
            next.back().parameters[name] = text;
            if (sweep) next.back().name += fmt::format(" {}={}", name, text);
          }
        all = std::move(next);
      }
    }
    if (const auto match = object.find("match")) {
      for (BenchRun& one : all) one.match = read_match(*match, one);
    }
    object.finish();
    for (const BenchRun& one : all) {
      if (!run_files_.insert(file_name_of(one.name)).second)
        value.fail(fmt::format("is another run called \"{}\": give it a \"name\"", one.name));
      plan_.runs.push_back(one);
      run_names_.insert(one.name);
      if (plan_.runs.size() > kMaxRuns)
        value.fail(fmt::format("is more than the {} runs that a plan may have", kMaxRuns));
    }
  }

  // Parameters of virtual lights and clamping, that every integrator has.
  bool is_common(const std::string& name) const {
    const auto common = api::params("exhaustive", api_);
    return std::any_of(common.begin(), common.end(), [&](const auto& info) { return name == info.id; });
  }

  BenchMatch read_match(const JsonValue& value, const BenchRun& run) {
    JsonObject object(value);
    BenchMatch m;
    std::vector<std::string> measures = kErrorMeasures;
    measures.insert(measures.end(), kTimeMeasures.begin(), kTimeMeasures.end());
    m.measure = measures[object.need("measure").choice(measures)];
    const JsonValue to = object.need("to");
    if (to.raw().is_string()) {
      m.run = to.text();
      known_run(to, m.run);
    } else {
      m.target = to.number(1e-12, 1e12);
    }
    const JsonValue vary = object.need("vary");
    m.vary = vary.text();
    lumicut_param_info info{};
    bool found = false;
    std::vector<std::string> names;
    for (const auto& known : api::params(run.integrator, api_)) {
      names.emplace_back(known.id);
      if (m.vary == known.id) info = known, found = true;
    }
    if (!found || info.type > LUMICUT_INT || is_common(m.vary)) {
      const std::string near = io::nearest_word(m.vary, names);
      vary.fail(fmt::format("is \"{}\", but must be a parameter of {} that is a number and its own{}", m.vary,
                            run.integrator,
                            near.empty() || near == m.vary ? "" : fmt::format("; did you mean \"{}\"?", near)));
    }
    m.integer = info.type == LUMICUT_INT;
    const JsonValue range = object.need("range");
    const auto ends = range.numbers(2);
    m.low = ends[0], m.high = ends[1];
    if (!(m.low > 0 && m.low < m.high)) range.fail_expected("[low, high] with 0 < low < high");
    if (m.low < info.minimum || m.high > info.maximum)
      range.fail(fmt::format("reaches beyond {} to {}, which {} may be", info.minimum, info.maximum, m.vary));
    const auto usual = run.parameters.find(m.vary);
    const double start = usual != run.parameters.end() ? std::strtod(usual->second.c_str(), nullptr)
                                                       : std::strtod(info.default_text, nullptr);
    m.start = object.number("start", std::clamp(start, m.low, m.high), m.low, m.high);
    static const std::vector<std::string> kFiner = {"smaller", "larger"};
    const auto finer = object.find("finer");
    m.finer_is_larger = finer ? finer->choice(kFiner) == 1 : m.integer;
    m.tolerance = object.number("tolerance", m.of_time() ? 0.1 : 0.03, 1e-6, 10);
    m.steps = static_cast<int>(object.integer("steps", 10, 1, 100));
    object.finish();
    return m;
  }

  const io::Api& api_;
  api::Device device_{api_, 1};
  std::vector<std::string> integrators_;
  BenchScene usual_;
  BenchPlan plan_;
  std::set<std::string> scene_names_, run_files_;  // as names of files
  std::set<std::string> run_names_;
  size_t groups_ = 0;
};

}  // namespace

BenchPlan parse_bench_plan(const std::string& text, const std::string& name, const std::string& folder,
                           const io::Api& api) {
  const nlohmann::json json = io::parse_json(text, name);
  return PlanReader(folder, api).read(JsonValue(json, name, ""));
}

BenchPlan read_bench_plan(const std::string& path, const io::Api& api) {
  return parse_bench_plan(io::read_whole_file(path, uint64_t{1} << 26), path, fs::path(path).parent_path().string(),
                          api);
}

}  // namespace lumicut::tools
