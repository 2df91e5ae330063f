#include "integrators/traits.h"

#include <map>
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

namespace {

std::map<std::string_view, ParamTable> all_tables() {
  std::map<std::string_view, ParamTable> tables;
  for (const IntegratorEntry& entry : integrators()) {
    ParamTable& table = tables[entry.id];
    table = common_params();
    if (entry.params == nullptr) continue;
    ParamTable own = entry.params();
    table.params.insert(table.params.end(), own.params.begin(), own.params.end());
    table.own = std::move(own.own);
  }
  return tables;
}

}  // namespace

const ParamTable& all_params(const IntegratorEntry& entry) {
  static const auto& tables = *new std::map(all_tables());  // hosts keep pointers to its texts
  return tables.at(entry.id);
}

std::vector<const Param*> effective_params(const IntegratorEntry& entry) {
  std::vector<const Param*> shown;
  for (const Param& p : all_params(entry).params)
    if (!p.of_virtual_lights || entry.light_source == LightSource::virtual_lights) shown.push_back(&p);
  return shown;
}

}  // namespace lumicut
