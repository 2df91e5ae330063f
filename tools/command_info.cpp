// lumicut info: the library as it describes itself.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "io/library.h"
#include "tools/commands.h"

namespace lumicut::tools {

using nlohmann::ordered_json;

namespace {

ordered_json parameters(const io::Api& api, const char* integrator) {
  static const char* const kTypes[] = {"float", "int", "bool", "choice"};
  ordered_json list = ordered_json::array();
  for (const auto& p : api::params(integrator, api)) {
    ordered_json entry = {{"id", p.id}, {"type", p.type < 4 ? kTypes[p.type] : "?"}, {"default", p.default_text}};
    if (p.type <= LUMICUT_INT) entry["minimum"] = p.minimum, entry["maximum"] = p.maximum;
    if (p.type == LUMICUT_CHOICE) entry["choices"] = p.choices;
    entry["unit"] = p.unit, entry["label"] = p.label, entry["description"] = p.description;
    list.push_back(entry);
  }
  return list;
}

ordered_json traits(const lumicut_integrator_info& info) {
  static constexpr std::pair<uint32_t, const char*> kNames[] = {
      {LUMICUT_VIRTUAL_LIGHTS, "virtual_lights"},     {LUMICUT_LIGHT_GROUPS, "light_groups"},
      {LUMICUT_COMPENSATION, "compensation"},         {LUMICUT_SAVED_STATE, "saved_state"},
      {LUMICUT_VIEW_INDEPENDENT, "view_independent"}, {LUMICUT_ALL_LIGHTS, "all_lights"}};
  ordered_json names = ordered_json::array();
  for (const auto& [flag, name] : kNames)
    if ((info.traits & flag) != 0) names.push_back(name);
  return names;
}

ordered_json presets(const lumicut_integrator_info& info) {
  ordered_json all = ordered_json::object();
  for (const auto& [name, text] : {std::pair{"interactive", info.interactive},
                                   {"preview", info.preview},
                                   {"draft", info.draft},
                                   {"good", info.good},
                                   {"reference", info.reference}})
    if (text != nullptr && *text != 0) all[name] = text;
  return all;
}

// Those of this build.
ordered_json accels(const io::Api& api) {
  ordered_json names = ordered_json::array();
  const io::Handle<lumicut_device> device = api::Device(api, 1);
  for (const char* name : {"bvh", "embree"}) {
    lumicut_scene_desc desc{};
    desc.struct_size = sizeof(desc);
    desc.accel = name;
    io::Handle<lumicut_scene> scene(api);
    if (api.scene_create(device.get(), &desc, scene.out()) == LUMICUT_OK) names.push_back(name);
  }
  return names;
}

ordered_json describe(const io::Library& library) {
  const io::Api& api = library.api();
  uint32_t major = 0, minor = 0;
  ordered_json all = {{"version", api.version(&major, &minor)}};
  all["abi"] = fmt::format("{}.{}", major, minor);
  all["library"] = library.path();
  all["accels"] = accels(api);
  all["integrators"] = ordered_json::array();
  for (const auto& info : api::integrators(api))
    all["integrators"].push_back({{"id", info.id},
                                  {"label", info.label},
                                  {"description", info.description},
                                  {"source", info.source},
                                  {"traits", traits(info)},
                                  {"presets", presets(info)},
                                  {"parameters", parameters(api, info.id)}});
  all["channels"] = ordered_json::array();
  for (const auto& info : api::channels(api))
    all["channels"].push_back(
        {{"name", info.name}, {"components", info.components}, {"description", info.description}});
  return all;
}

std::string text(const ordered_json& value) { return value.get<std::string>(); }

std::string listed(const ordered_json& names) {
  std::string out;
  for (const auto& name : names) out += (out.empty() ? "" : ", ") + text(name);
  return out;
}

void print_text(const ordered_json& all) {
  fmt::print("lumicut {}, ABI {}, {}\n", text(all["version"]), text(all["abi"]), text(all["library"]));
  fmt::print("rays: {}\n", listed(all["accels"]));
  for (const auto& integrator : all["integrators"]) {
    fmt::print("\n{}: {}\n  {}\n", text(integrator["id"]), text(integrator["description"]), text(integrator["source"]));
    for (const auto& [name, parameters] : integrator["presets"].items())
      fmt::print("  {}: {}\n", name, text(parameters));
    for (const auto& p : integrator["parameters"]) {
      std::string range = text(p["type"]);
      if (p.contains("minimum"))
        range = fmt::format("{} to {}", p["minimum"].get<double>(), p["maximum"].get<double>());
      if (p.contains("choices")) range = text(p["choices"]);
      if (!text(p["unit"]).empty()) range += " " + text(p["unit"]);
      fmt::print("  -p {:<28} {} ({})\n", text(p["id"]) + "=" + text(p["default"]), text(p["description"]), range);
    }
  }
  fmt::print("\nlayers of an image:\n");
  for (const auto& c : all["channels"]) fmt::print("  {:<12} {}\n", text(c["name"]), text(c["description"]));
}

}  // namespace

std::string version_text() {
  const io::Library library;
  uint32_t major = 0, minor = 0;
  const char* version = library.api().version(&major, &minor);
  return fmt::format("lumicut {}, ABI {}.{}\nrays: {}", version, major, minor, listed(accels(library.api())));
}

void add_info(CLI::App& app) {
  auto* command = app.add_subcommand("info", "Version, integrators and their parameters");
  const auto json = std::make_shared<bool>(false);
  command->add_flag("--json", *json, "Print JSON instead of text");
  command->callback([json] {
    const io::Library library;
    const auto all = describe(library);
    if (*json) {
      fmt::print("{}\n", all.dump(2));
    } else {
      print_text(all);
    }
  });
}

}  // namespace lumicut::tools
