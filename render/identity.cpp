#include "render/identity.h"

#include <charconv>

#include "hwy/highway.h"

namespace lumicut {

void Identity::add_text(std::string_view name, const std::string& value) {
  text_.append(name).append("=").append(value).append("\n");
}

void Identity::add_hash(std::string_view name, uint64_t hash) {
  char digits[16];
  const auto end = std::to_chars(digits, digits + sizeof(digits), hash, 16).ptr;
  add_text(name, "#" + std::string(digits, end));
}

void Identity::add(const Params& params) {
  for (const Param& p : params.table()) add_text(p.id, *params.text(p.id));
}

void Identity::add(const Scene& scene, bool camera) {
  scene.for_each_part([&](std::string_view name, const auto& part) {
    if (camera || name != "camera" || scene.asks_for_camera()) add_hash(name, hash_value(0, part));
  });
}

void Identity::add_virtual_lights(const VplSet* lights) {
  add_hash("virtual lights", lights == nullptr ? 0 : hash_value(0, *lights));
}

std::string Difference::text() const {
  return saved.starts_with('#') ? "other " + name : name + "=" + saved + " instead of " + now;
}

std::optional<Difference> difference(const std::string& saved, const std::string& now) {
  std::string_view a = saved, b = now;
  while (!a.empty() || !b.empty()) {
    const std::string_view one = a.substr(0, a.find('\n')), other = b.substr(0, b.find('\n'));
    if (one != other) {
      const auto value = [](std::string_view line) {
        return std::string(line.substr(std::min(line.size(), line.find('=') + 1)));
      };
      const std::string_view name = other.substr(0, other.find('='));
      // Lines of another meaning come of another version or of damage.
      if (!one.starts_with(name)) return Difference{"fields", "#", ""};
      return Difference{std::string(name), value(one), value(other)};
    }
    a.remove_prefix(std::min(a.size(), one.size() + 1)), b.remove_prefix(std::min(b.size(), other.size() + 1));
  }
  return std::nullopt;
}

std::string instruction_class(const Scene& scene) {
  const int64_t targets = hwy::SupportedTargets() & HWY_TARGETS;
  const int64_t best = targets & -targets;  // better ones have lower bits
#if HWY_ARCH_X86
  bool ours = true;
  scene.for_each_part([&](std::string_view name, const auto& part) {
    using Part = std::remove_cvref_t<decltype(part)>;
    if constexpr (std::is_same_v<Part, Scene::Config>) ours = ours && part.accel != "embree";
    if constexpr (std::is_same_v<Part, bool>) ours = ours && !(name == "host_trace" && part);
  });
  if (best > HWY_AVX2) return "SSE4 or older";
  return ours ? "AVX2 or AVX-512" : best <= HWY_AVX3 ? "AVX-512" : "AVX2";
#else
  static_cast<void>(scene);
  return hwy::TargetName(best);
#endif
}

}  // namespace lumicut
