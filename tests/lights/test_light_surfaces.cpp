// Lights as rays meet them, and the tree over their boxes.
#include "lights/light_surfaces.h"

#include <gtest/gtest.h>

#include <set>

#include "tests/support/test_scenes.h"

namespace lumicut {
namespace {

constexpr float kFar = std::numeric_limits<float>::infinity();

std::unique_ptr<Scene> scene_of(std::vector<Light> lights) {
  auto scene = std::make_unique<Scene>(Scene::Config{kDefaultAccel, true});
  scene->set_lights(std::move(lights));
  test::commit_quad(*scene, test::diffuse(0.5f, 0.5f, 0.5f), {-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0});
  return scene;
}

Light panel(LightType type, float z, float size = 1) {
  Light l;
  l.type = type, l.position = {0, 0, z}, l.value = {2, 2, 2};
  l.u = {size, 0, 0}, l.v = {0, -size, 0};  // shines down
  return l;
}
Light lamp(float z, float radius) {
  Light l;
  l.type = LightType::point, l.position = {0, 0, z}, l.radius = radius, l.value = {2, 2, 2};
  return l;
}

// The lights that a ray from `origin` towards +z meets.
std::multiset<uint32_t> met(const Scene& scene, const Vec3f& origin, float far = kFar, bool panels_alone = false) {
  const LightSurfaces surfaces(scene, LightSurfaces::RaysOf::mirrors);
  std::multiset<uint32_t> hits;
  const auto note = [&](const LightSurfaces::Hit& hit) { hits.insert(hit.light); };
  if (panels_alone)
    surfaces.for_each_panel(origin, {0, 0, 1}, far, note);
  else
    surfaces.for_each_hit(origin, {0, 0, 1}, far, note);
  return hits;
}

TEST(LightSurfaces, HoweverManyLieInOnePlaceEachIsMetOnce) {
  std::vector<Light> lights;
  for (int i = 0; i < 50; ++i)
    for (const LightType type : {LightType::rectangle, LightType::disk}) lights.push_back(panel(type, 1));
  for (int i = 0; i < 50; ++i) lights.push_back(lamp(1, 0.5f));
  lights.push_back(panel(LightType::rectangle, 1, 3));  // wider, in the same plane
  lights.push_back(panel(LightType::rectangle, 2));     // behind them
  const auto scene = scene_of(std::move(lights));
  const auto hits = met(*scene, {0.1f, 0.2f, 0});
  EXPECT_EQ(hits.size(), 152u);
  EXPECT_EQ(std::set<uint32_t>(hits.begin(), hits.end()).size(), 152u);
}

TEST(LightSurfaces, AreMetWithinTheirEdgesFromTheFrontAndBeforeWhatIsFar) {
  Light skewed = panel(LightType::rectangle, 1);
  skewed.v = {0.5f, -1, 0};
  const auto scene = scene_of({panel(LightType::rectangle, 1), panel(LightType::disk, 1), skewed, lamp(1, 0.4f)});
  using Hits = std::multiset<uint32_t>;
  EXPECT_EQ(met(*scene, {0, 0, 0}), (Hits{0, 1, 2, 3}));
  EXPECT_EQ(met(*scene, {0.45f, 0.45f, 0}), (Hits{0}));      // a disk has no corners; of the skewed one it is beyond
  EXPECT_EQ(met(*scene, {0.45f, -0.45f, 0}), (Hits{0, 2}));  // there it is not
  EXPECT_EQ(met(*scene, {0.65f, -0.45f, 0}), (Hits{2}));     // beyond the straight ones alone
  EXPECT_EQ(met(*scene, {0, 0, 1.5f}), (Hits{}));            // behind
  EXPECT_EQ(met(*scene, {0, 0, 0}, 0.99f), (Hits{3}));       // the lamp begins at .6
  EXPECT_EQ(met(*scene, {0, 0, 0}, kFar, true), (Hits{0, 1, 2}));
}

TEST(LightBoxes, FindEveryBoxThatARayMeets) {
  Rng rng(5, Stage::test);
  std::vector<Aabb> boxes;
  for (int i = 0; i < 300; ++i) {
    Aabb& box = boxes.emplace_back();
    const Vec3f middle = test::random_point(rng, 10);
    const float flat = i % 3 == 0 ? 0.0f : 1.0f;
    box.extend(middle), box.extend(middle + Vec3f{2 * rng.next_float(), rng.next_float(), flat});
    if (i % 7 == 0) boxes.back() = boxes.front();
  }
  const LightBoxes tree(boxes);
  for (int ray = 0; ray < 2000; ++ray) {
    const Vec3f origin = test::random_point(rng, 12);
    Vec3f direction = test::random_direction(rng);
    if (ray % 10 == 0) direction = {0, ray % 20 == 0 ? 1.0f : -1.0f, 0};
    const float far = ray % 2 == 0 ? kFar : 5.0f;
    std::multiset<uint32_t> found;
    tree.for_each(origin, direction, far, [&](uint32_t i) { found.insert(i); });
    for (uint32_t i = 0; i < boxes.size(); ++i) {
      EXPECT_LE(found.count(i), 1u);
      // Of places along the ray that lie in the box some are enough to see that it must be found.
      for (int k = 0; k < 40; ++k) {
        const float t = static_cast<float>(k) * 0.5f;
        if (t < far && boxes[i].contains(origin + direction * t)) {
          EXPECT_EQ(found.count(i), 1u) << ray << " " << i;
        }
      }
    }
    EXPECT_LT(found.size(), boxes.size() / 2);  // and not nearly all of them
  }
}

}  // namespace
}  // namespace lumicut
