#include "integrators/traits.h"

#include <string_view>
#include <utility>

namespace lumicut {

#define LUMICUT_INTEGRATOR(name, ...) extern const IntegratorEntry name##_integrator;
#include "integrators/integrator_list.inc"
#undef LUMICUT_INTEGRATOR

std::span<const IntegratorEntry> integrators() {
  static const IntegratorEntry table[] = {
#define LUMICUT_INTEGRATOR(name, ...) name##_integrator,
#include "integrators/integrator_list.inc"
#undef LUMICUT_INTEGRATOR
  };
  return table;
}

IntegratorTraits traits(const IntegratorEntry& entry) {
  static constexpr std::pair<std::string_view, IntegratorTraits> table[] = {
#define LUMICUT_INTEGRATOR(name, ...) {#name, {__VA_ARGS__}},
#include "integrators/integrator_list.inc"
#undef LUMICUT_INTEGRATOR
  };
  for (const auto& [id, of] : table)
    if (id == entry.id) return of;
  return {};
}

const IntegratorEntry* find_integrator(const std::string& id) {
  for (const IntegratorEntry& e : integrators())
    if (id == e.id) return &e;
  return nullptr;
}

std::vector<uint8_t> Integrator::save_state() const {
  throw Error(ErrorCode::unsupported, "this integrator has no state to save");
}

void Integrator::load_state(const Scene&, const VplSet&, const Params&, std::span<const uint8_t>, ShadeContext) {
  throw Error(ErrorCode::unsupported, "this integrator has no state to load");
}

std::vector<ParamInfo> all_params(const IntegratorEntry& entry) {
  std::vector<ParamInfo> table = common_params();
  for (const ParamInfo& p : entry.params()) table.push_back(p);
  return table;
}

std::vector<ParamInfo> effective_params(const IntegratorEntry& entry) {
  std::vector<ParamInfo> table = all_params(entry);
  if (entry.light_source == LightSource::emitters)
    std::erase_if(table, [](const ParamInfo& p) { return p.of_virtual_lights; });
  return table;
}

}  // namespace lumicut
