// What row_column_sampling shares with light_slice is in test_light_slice.cpp.
#include <gtest/gtest.h>

#include "tests/support/render.h"

namespace lumicut {

TEST(RowColumnSampling, UsesTheRowsAndColumnsItIsTold) {
  const auto scene = test::make_room();
  const VplSet vpls = test::lights_of(*scene, 4000);
  for (const char* sampled : {"0", "0.667", "1"}) {
    const auto frame = test::render(*scene, "row_column_sampling", vpls, {{"columns", "120"}, {"sampled", sampled}});
    for (float clusters : frame.cut_size) EXPECT_LE(clusters, 120.0f) << sampled;
    EXPECT_GT(*std::max_element(frame.cut_size.begin(), frame.cut_size.end()), 90.0f) << sampled;
    // At most 300 rows of 4000 rays, and 120 rays a point.
    EXPECT_LE(frame.counters.rays, 300u * 4000u + 120u * 64 * 48) << sampled;
  }
}

TEST(RowColumnSampling, MeanOverSeedsIsTheExhaustiveSum) {
  // Each cluster's light is drawn by its share and scaled by its inverse: right on the average, given that rows see
  // every light. 24 seeds; errors of images are about 24^-1/2 of one image's.
  const auto scene = test::make_room();
  VplSet vpls = test::lights_of(*scene, 1000);
  for (Vpl& v : vpls.lights) v.intensity = Rgb{1, 1, 1} * luminance(v.intensity);
  const auto reference = test::render(*scene, "exhaustive", vpls, {}, {.width = 32, .height = 24});
  std::vector<Rgb> mean(reference.radiance.size());
  double single = 0;
  constexpr int kSeeds = 24;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    const auto frame = test::render(*scene, "row_column_sampling", vpls,
                                    {{"columns", "60"}, {"seed", std::to_string(seed)}}, {.width = 32, .height = 24});
    for (size_t i = 0; i < mean.size(); ++i) mean[i] += frame.radiance[i] * (1.0f / kSeeds);
    single += test::rmse_over_mean(frame.radiance, reference.radiance) / kSeeds;
  }
  // Three times the expected 1/√24: biased estimates stay near 1.
  EXPECT_LT(test::rmse_over_mean(mean, reference.radiance), 0.6 * single);
}

}  // namespace lumicut
