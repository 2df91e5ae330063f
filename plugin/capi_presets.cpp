// Extension "lumicut.presets/1": named qualities for whole frames. Measured by bench/presets.py.
#include <array>

#include "integrators/traits.h"
#include "plugin/extensions.h"
#include "plugin/include/lumicut/lumicut_presets.h"

namespace lumicut {

namespace {

IntegratorTraits traits_of(const char* id) { return traits(*find_integrator(id)); }

std::array<lumicut_preset, 4> make_presets() {
  const IntegratorTraits illumination_cut = traits_of("illumination_cut"), lightcuts = traits_of("lightcuts"),
                         exhaustive = traits_of("exhaustive");
  return {{{"draft", "Draft",
            "For a first look: one image of few lights with wide bounds, not denoised. Corners and gloss are too dark",
            "illumination_cut", illumination_cut.draft, 1, 1, 0, 0},
           {"good", "Good",
            "For most images, and what is rendered when nobody chose: the mean of 16 iterations of 3,000 lights each, "
            "with what the clamp takes brought back, denoised",
            "lightcuts", lightcuts.good, 1, 16, LUMICUT_DENOISE, 0},
           {"final", "Final",
            "For what you keep: as Good, in 128 iterations, or fewer where the error is known to be 2 % before",
            "lightcuts", lightcuts.good, 1, 128, LUMICUT_DENOISE, 0.02f},
           {"reference", "Reference",
            "To compare with path tracers: 256 iterations that each sum all of 4,000 lights anew, with what the clamp "
            "takes brought back, denoised. Slow",
            "exhaustive", exhaustive.reference, 1, 256, LUMICUT_DENOISE, 0}}};
}

}  // namespace

const void* presets_extension() {
  static const std::array<lumicut_preset, 4> kPresets = make_presets();
  static const lumicut_presets_extension kTable = {sizeof(lumicut_presets_extension), kPresets.size(), kPresets.data(),
                                                   1, 0};
  return &kTable;
}

}  // namespace lumicut
