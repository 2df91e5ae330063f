// What a file of ours was made for, as text: a line "name=value" for each thing that decides what it holds.
#pragma once

#include <optional>
#include <string>

#include "core/number_text.h"
#include "integrators/integrator.h"
#include "lights/vpl.h"
#include "render/hash.h"
#include "scene/scene.h"

namespace lumicut {

class Identity {
 public:
  // Numbers and texts as they are; all else by its hash, after a '#'.
  template <typename T>
  void add(std::string_view name, const T& value) {
    if constexpr (std::is_same_v<T, std::string>)
      add_text(name, value);
    else if constexpr (std::is_floating_point_v<T>)
      add_text(name, number_text(value));
    else if constexpr (std::is_integral_v<T>)
      add_text(name, number_text(uint64_t{value}));
    else
      add_hash(name, hash_value(0, value));
  }
  template <HasFields T>
  void add_fields(const T& value) {
    for_each_field(value, [this](std::string_view name, const auto& field) { this->add(name, field); });
  }
  void add(const Params& params);
  // All that the host set; `camera` false: but that.
  void add(const Scene& scene, bool camera);
  // `lights`: the host's own; null: traced ones.
  void add_virtual_lights(const VplSet* lights);

  const std::string& text() const { return text_; }

 private:
  void add_text(std::string_view name, const std::string& value);
  void add_hash(std::string_view name, uint64_t hash);

  std::string text_;
};

struct Difference {
  std::string name, saved, now;
  // "width=48 instead of 40", or "other materials".
  std::string text() const;
};
// The first line in which two identities differ.
std::optional<Difference> difference(const std::string& saved, const std::string& now);

// Of the processor's best instructions, those that give the same image bit for bit. Our own code rounds alike with fused
// multiply-adds, and alike without them; Embree, and a host's tracer for all that is known, with AVX-512 otherwise than
// with AVX2.
std::string instruction_class(const Scene& scene);

}  // namespace lumicut
