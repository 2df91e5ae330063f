#include <charconv>
#include <cmath>

#include "core/error.h"
#include "integrators/integrator.h"

namespace lumicut {

namespace {

bool has_choice(const char* choices, const std::string& value) {
  const std::string all = std::string("|") + choices + "|";
  return !value.empty() && value.find('|') == std::string::npos && all.find("|" + value + "|") != std::string::npos;
}

std::string number_text(double v) {
  char buffer[32];
  const auto end = std::to_chars(buffer, buffer + sizeof buffer, v).ptr;
  return {buffer, end};
}

bool parse_number(const std::string& text, double& out) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), out);
  return error == std::errc{} && end == text.data() + text.size();
}

}  // namespace

Params::Params(std::vector<ParamInfo> table) : table_(std::move(table)) {
  for (const ParamInfo& p : table_) values_[p.id] = p.default_text;
}

const ParamInfo* Params::find(const std::string& name) const {
  for (const ParamInfo& p : table_)
    if (name == p.id) return &p;
  return nullptr;
}

void Params::set(const std::string& name, const std::string& value) {
  const ParamInfo* p = find(name);
  if (p == nullptr) {
    std::string known;
    for (const ParamInfo& q : table_) known += (known.empty() ? "" : ", ") + std::string(q.id);
    fail_argument("no parameter \"" + name + "\"; there are: " + known);
  }
  std::string text = value;
  if (p->type == ParamType::choice) {
    if (!has_choice(p->choices, value))
      fail_argument("parameter " + name + ": \"" + value + "\" is not one of " + p->choices);
  } else if (p->type == ParamType::boolean) {
    if (value == "true" || value == "1" || value == "on" || value == "yes")
      text = "1";
    else if (value == "false" || value == "0" || value == "off" || value == "no")
      text = "0";
    else
      fail_argument("parameter " + name + ": \"" + value + "\" is neither true nor false");
  } else {
    double number = 0;
    if (!parse_number(value, number) || !std::isfinite(number))
      fail_argument("parameter " + name + ": \"" + value + "\" is not a number");
    if (p->type == ParamType::integer && number != std::floor(number))
      fail_argument("parameter " + name + ": " + value + " is not a whole number");
    if (number < p->minimum || number > p->maximum)
      fail_argument("parameter " + name + ": " + value + " is not in [" + number_text(p->minimum) + ", " +
                    number_text(p->maximum) + "]");
  }
  values_[name] = text;
}

const std::string* Params::text(const std::string& name) const {
  const auto it = values_.find(name);
  return it == values_.end() ? nullptr : &it->second;
}

double Params::real(const std::string& name) const {
  double number = 0;
  const std::string* t = text(name);
  if (t == nullptr || !parse_number(*t, number))
    throw Error(ErrorCode::internal, "parameter " + name + " is not a number");
  return number;
}

const std::string& Params::choice(const std::string& name) const {
  const std::string* t = text(name);
  if (t == nullptr) throw Error(ErrorCode::internal, "no parameter " + name);
  return *t;
}

std::vector<ParamInfo> common_params() {
  return {
      {"vpls", "Virtual lights", "How many virtual point lights stand for the scene's light", "lights",
       ParamType::integer, "60000", 1, 1e8, "", true},
      {"seed", "Seed", "Same seed, same image", "", ParamType::integer, "1", 0, 4294967295.0},
      {"max_depth", "Bounces", "Surfaces that a light path may meet; 0: direct light alone", "", ParamType::integer,
       "32", 0, 1024},
      {"direct_share", "Direct share",
       "Share of the virtual lights that is spent on the direct light of extended lamps", "", ParamType::real, "0.25",
       0.01, 1, "", true},
      {"environment_vpls", "Environment lights",
       "How many of the virtual lights stand for the environment; 0: its share of the power among those for direct "
       "light",
       "lights", ParamType::integer, "0", 0, 1e8, "", true},
      {"clamp_relative", "Clamp (relative)",
       "No virtual light is taken to be nearer than this share of the scene's radius", "of the scene's radius",
       ParamType::real, "0.05", 0, 1, "", true},
      {"clamp_distance", "Clamp distance",
       "No virtual light is taken to be nearer than this; 0: use the relative clamp", "scene units", ParamType::real,
       "0", 0, 1e30, "", true},
      {"virtual_lights", "Virtual lights are",
       "points, which leave bright dots on glossy surfaces and in corners; or spheres as wide as they lie apart: no "
       "dots and nothing clamped, at the price of a slight blur and slower shading",
       "", ParamType::choice, "points", 0, 0, "points|spheres", true},
      {"sphere_scale", "Sphere size", "Radius of the spheres", "of the distance to the tenth nearest", ParamType::real,
       "1", 0.001, 10, "", true},
      {"compensate", "Compensate",
       "Rays bring back the light that the clamp takes away, and what glossy surfaces throw on others: no energy is "
       "lost, at the price of noise that passes average out",
       "", ParamType::boolean, "0", 0, 0, "", true},
  };
}

float clamp_distance(const Params& params, const Scene& scene) {
  const double absolute = params.real("clamp_distance");
  return static_cast<float>(absolute > 0.0 ? absolute : params.real("clamp_relative") * scene.radius());
}

float sphere_scale(const Params& params) {
  return params.choice("virtual_lights") == "spheres" ? static_cast<float>(params.real("sphere_scale")) : 0.0f;
}

}  // namespace lumicut
