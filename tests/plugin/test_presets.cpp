// Extension "lumicut.presets/1": each preset is a render that the library takes.
#include <gtest/gtest.h>

#include <span>
#include <sstream>

#include "box_scene.h"
#include "lumicut/lumicut_presets.h"

namespace {

using namespace box;

std::span<const lumicut_preset> presets() {
  const auto* table = static_cast<const lumicut_presets_extension*>(lumicut_get_extension(LUMICUT_PRESETS_EXTENSION));
  EXPECT_NE(table, nullptr);
  EXPECT_EQ(table->struct_size, sizeof(lumicut_presets_extension));
  EXPECT_LT(table->usual, table->count);
  EXPECT_STREQ(table->presets[table->usual].id, "good");
  return {table->presets, table->count};
}

TEST(Presets, RenderWithParametersThatTheirIntegratorHas) {
  const api::Device device(1);
  const api::Scene s = scene(device);
  for (const lumicut_preset& preset : presets()) {
    SCOPED_TRACE(preset.id);
    api::Integrator method(device, preset.integrator);
    std::stringstream words(preset.parameters);
    int set = 0;
    for (std::string word; words >> word; ++set) {
      const size_t equals = word.find('=');
      ASSERT_NE(equals, std::string::npos) << word;
      method.set(word.substr(0, equals).c_str(), word.substr(equals + 1).c_str());
    }
    EXPECT_GT(set, 0);
    auto frame = box::frame(8, 6);
    frame.samples = preset.samples, frame.passes = std::min(preset.passes, 2u);
    frame.target_error = preset.target_error, frame.flags = preset.flags;
    const api::Render render(method, s, frame);
    render.wait();
    EXPECT_EQ(render.status().state, uint32_t{LUMICUT_DONE});
  }
}

TEST(Presets, GrowInWorkAndDenoiseWhatHasPasses) {
  const auto all = presets();
  for (size_t i = 0; i < all.size(); ++i) {
    EXPECT_EQ(all[i].passes > 1, (all[i].flags & LUMICUT_DENOISE) != 0) << all[i].id;
    if (i > 0) {
      EXPECT_GT(all[i].passes, all[i - 1].passes) << all[i].id;
    }
  }
}

}  // namespace
