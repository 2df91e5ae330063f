#include <gtest/gtest.h>

#include "clustering/bounds.h"
#include "clustering/light_kernel.h"
#include "tests/clustering/random_lighting.h"

namespace lumicut {

TEST(Bounds, AMillionRandomPairsNeverPassTheBoundOfTheirCluster) {
  uint64_t pairs = 0, tight = 0, zero_bounds = 0;
  for (uint32_t trial = 0; pairs < 1200000; ++trial) {
    Rng rng(trial, Stage::test);
    const auto kind = static_cast<VplKind>(trial % kVplKinds);
    const bool glossy = rng.next_below(2) == 0;
    std::vector<Vpl> lights = test::random_cluster(rng, kind, 2 + rng.next_below(40));
    const float clamp = rng.next_below(3) == 0 ? 0.0f : 0.2f;
    for (Vpl& v : lights) v.clamp2 = clamp * clamp * rng.next_float() * rng.next_float();
    const ShadePoints points = test::random_points(rng, kLanes, 1.5f, glossy);
    PointBlock block;
    block.load(points, 0);
    Progress progress;
    const LightTree tree = LightTree::build(lights, {LightTree::Method::agglomerative, 4.0f, 1, trial}, progress);
    for (uint32_t n = 0; n < tree.node_count(); ++n) {
      const LightNode& node = tree.node(n);
      float bounds[kLanes];
      light_node_bounds(node, block, bounds);
      // Leaves below this node: the worst light takes all of the node's intensity, as a representative would.
      for (const uint32_t l : test::lights_below(tree, n)) {
        for (size_t i = 0; i < kLanes; ++i) {
          const float value =
              luminance(light_point(tree.lights()[l], node.intensity, Falloff(test::random_profiles()), points.get(i)));
          ASSERT_LE(value, bounds[i]) << "trial " << trial << " node " << n << " point " << i << " kind "
                                      << static_cast<int>(kind) << " glossy " << glossy;
          tight += value > 0.9f * bounds[i];
          zero_bounds += bounds[i] == 0.0f;
          ++pairs;
        }
      }
    }
  }
  // A bound of infinity would pass as well: it must also be near, and able to say "nothing arrives".
  EXPECT_GT(tight, pairs / 20);
  EXPECT_GT(zero_bounds, pairs / 20);
}

TEST(Bounds, OfGgxAreAboutAsNearAsThoseOfBlinnLobesOfItsWidth) {
  for (const float alpha : {0.02f, 0.1f, 0.3f, 0.7f}) {
    double ratio[2];
    for (const int ggx : {0, 1}) {
      double bound = 0, value = 0;
      for (uint32_t trial = 0; trial < 2000; ++trial) {
        Rng rng(trial, Stage::test, 21);
        std::vector<Vpl> lights = test::random_cluster(rng, VplKind::oriented, 6);
        for (Vpl& v : lights) v.clamp2 = 0.04f;
        ShadePoints points;
        for (size_t i = 0; i < kLanes; ++i) {
          SurfacePoint p = test::random_surface(rng, 1.5f, false);
          p.diffuse = {};
          // Half of all lobes look at the lights: elsewhere they give next to nothing.
          const Vec3f to = normalize(lights[0].position - p.position);
          if (rng.next_below(2) == 0 && dot(to, p.normal) > 0) p.mirror = to;
          if (ggx != 0) {
            p.specular = {0.5f, 0.5f, 0.5f}, p.grazing = {1, 1, 1};
            p.lobe = kLobe<GgxReflection>, p.shape = alpha;
          } else {
            p.shape = 0.5f / (alpha * alpha) - 0.5f;
            p.specular = Rgb{0.5f, 0.5f, 0.5f} * cosine_lobe_scale(false, p.shape);
          }
          points.push(p);
        }
        points.finish();
        PointBlock block;
        block.load(points, 0);
        Progress progress;
        const LightTree tree = LightTree::build(lights, {LightTree::Method::agglomerative, 4.0f, 1, trial}, progress);
        const LightNode& root = tree.node(tree.roots()[0]);
        float bounds[kLanes];
        light_node_bounds(root, block, bounds);
        for (size_t i = 0; i < kLanes; ++i) {
          bound += std::log(1e-6 + bounds[i]);
          float most = 0;
          for (const Vpl& light : lights)
            most = std::max(most, luminance(light_point(light, root.intensity, {}, points.get(i))));
          value += std::log(1e-6 + most);
        }
      }
      ratio[ggx] = std::exp((bound - value) / (2000.0 * kLanes));
    }
    RecordProperty("alpha " + std::to_string(alpha),
                   "Blinn " + std::to_string(ratio[0]) + ", GGX " + std::to_string(ratio[1]));
    EXPECT_LT(ratio[1], 2.0 * ratio[0]) << alpha;
  }
}

TEST(Bounds, OfSpheresAreAboutAsNearAsThoseOfPoints) {
  for (const bool glossy : {false, true}) {
    double ratio[2];
    for (const bool spheres : {false, true}) {
      double sum = 0;
      uint64_t pairs = 0;
      for (uint32_t trial = 0; trial < 3000; ++trial) {
        Rng rng(trial, Stage::test, 22);
        std::vector<Vpl> lights = test::random_cluster(rng, VplKind::oriented, 6);
        for (Vpl& v : lights) v.clamp2 = 0.04f;
        const float radius = 0.02f + 0.2f * rng.next_float();
        for (Vpl& v : lights)
          if (spheres) v.kind = VplKind::sphere, v.radius() = radius * (1.0f + rng.next_float());
        const ShadePoints points = test::random_points(rng, kLanes, 1.5f, glossy);
        PointBlock block;
        block.load(points, 0);
        Progress progress;
        const LightTree tree = LightTree::build(lights, {LightTree::Method::agglomerative, 4.0f, 1, trial}, progress);
        const LightNode& root = tree.node(tree.roots()[0]);
        float bounds[kLanes];
        light_node_bounds(root, block, bounds);
        for (size_t i = 0; i < kLanes; ++i) {
          float most = 0;
          for (const Vpl& light : lights)
            most = std::max(most, luminance(light_point(light, root.intensity, {}, points.get(i))));
          if (!(most > 1e-4f)) continue;
          sum += std::log(bounds[i] / most);
          ++pairs;
        }
      }
      ratio[spheres] = std::exp(sum / static_cast<double>(pairs));
    }
    RecordProperty(glossy ? "glossy" : "diffuse",
                   "points " + std::to_string(ratio[0]) + ", spheres " + std::to_string(ratio[1]));
    std::printf("bound over value, %s: points %.2f, spheres %.2f\n", glossy ? "glossy" : "diffuse", ratio[0], ratio[1]);
    // A lobe counts with its largest value in the cone, not its mean.
    EXPECT_LT(ratio[1], (glossy ? 2.5 : 1.6) * ratio[0]) << glossy;
  }
}

TEST(Bounds, DoNotDependOnTheScaleOfTheScene) {
  for (uint32_t trial = 0; trial < 200; ++trial) {
    Rng rng(trial, Stage::test, 7);
    const auto kind = static_cast<VplKind>(trial % kVplKinds);
    std::vector<Vpl> lights = test::random_cluster(rng, kind, 8);
    ShadePoints points = test::random_points(rng, kLanes, 1.5f, true);
    float bounds[2][kLanes];
    for (int scaled = 0; scaled < 2; ++scaled) {
      const float s = scaled ? 1024.0f : 1.0f;  // a power of two: no rounding of its own
      if (scaled) {
        for (Vpl& v : lights)
          v.position = v.position * s, v.from_centre = v.from_centre * s,
          v.edge_or_radius *= kind == VplKind::sphere ? s : 1.0f,
          v.intensity = v.kind == VplKind::directional ? v.intensity : v.intensity * (s * s);
        for (auto& axis : points.position)
          for (float& x : axis) x *= s;
      }
      for (Vpl& v : lights) v.clamp2 = 0.01f * s * s;
      PointBlock block;
      block.load(points, 0);
      Progress progress;
      const LightTree tree = LightTree::build(lights, {LightTree::Method::agglomerative, 4.0f * s, 1, 1}, progress);
      light_node_bounds(tree.node(tree.roots()[0]), block, bounds[scaled]);
    }
    for (size_t i = 0; i < kLanes; ++i) EXPECT_NEAR(bounds[1][i], bounds[0][i], 1e-4f * bounds[0][i]) << trial;
  }
}

}  // namespace lumicut
