// What is prepared again when parameters change, and what is kept.
#include <gtest/gtest.h>

#include <set>

#include "render/preparation.h"
#include "tests/support/params.h"
#include "tests/support/test_scenes.h"

namespace {

using namespace lumicut;

std::string key(const Params& params) { return tracing_key(vpl_options(params.common())); }

TEST(TracingKey, ChangesWithEachParameterOfLightTracingAndWithNoOther) {
  const std::set<std::string> tracing = {
      "vpls", "seed", "max_depth", "direct_share", "environment_vpls", "virtual_lights", "sphere_scale"};
  for (const IntegratorEntry& entry : integrators()) {
    Params params(all_params(entry));
    params.set("virtual_lights", "spheres");
    size_t found = 0;
    for (const ParamInfo& info : params.table()) {
      Params other = params;
      const bool is_kind = std::string("virtual_lights") == info.id;
      other.set(info.id, is_kind ? "points" : test::another_value(info));
      EXPECT_EQ(key(other) != key(params), tracing.count(info.id) == 1) << entry.id << " " << info.id;
      found += tracing.count(info.id);
    }
    EXPECT_EQ(found, tracing.size());
  }
}

TEST(TracingKey, OfPointsDoesNotDependOnTheSizeOfSpheres) {
  Params params(all_params(*find_integrator("lightcuts")));
  const std::string points = key(params);
  params.set("sphere_scale", "2");
  EXPECT_EQ(key(params), points);
}

TEST(Preparation, KeepsVirtualLightsUntilAParameterOfTheirsChanges) {
  const auto scene = test::make_room();
  Preparation preparation(*find_integrator("exhaustive"));
  preparation.params.set("vpls", "200");
  const auto lights = [&] {
    Progress progress;
    Stats stats;
    preparation.prepare(*scene, nullptr, preparation.params, progress, stats);
    return preparation.prepared->vpls;
  };
  const auto first = lights();
  EXPECT_EQ(lights(), first);
  preparation.params.set("clamp_relative", "0.1"), preparation.params.set("compensate", "true");
  EXPECT_EQ(lights(), first);
  preparation.params.set("seed", "2");
  EXPECT_NE(lights(), first);
}

}  // namespace
