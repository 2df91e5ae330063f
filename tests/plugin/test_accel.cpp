// Level 1: rays against triangles, checked against trying every triangle.
#include <cstddef>
#include <random>

#include "box_scene.h"
#include "brute_force.h"
#include "tests/support/backends.h"

namespace {

using namespace box;

lumicut_accel_desc desc_of(const Geometry& g, const char* kind = lumicut::test::last_backend()) {
  auto d = make<lumicut_accel_desc>();
  d.kind = kind, d.robust = 1;
  d.positions = g.positions.data(), d.position_count = g.positions.size() / 3;
  d.indices = g.indices.data(), d.triangle_count = g.indices.size() / 3;
  return d;
}

std::vector<lumicut_rayhit> random_rays(size_t n) {
  std::mt19937 random(7);
  std::uniform_real_distribution<float> uniform(-1.5f, 1.5f);
  std::vector<lumicut_rayhit> rays(n);
  for (lumicut_rayhit& r : rays) {
    r.ray = {uniform(random),
             uniform(random),
             uniform(random) - 1,
             0,
             uniform(random),
             uniform(random),
             uniform(random),
             0,
             INFINITY,
             0xffffffffu,
             0,
             0};
    r.hit.geom_id = LUMICUT_NO_ID;
  }
  return rays;
}

class AccelKinds : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Accel, AccelKinds, testing::ValuesIn(lumicut::test::backends()),
                         [](const auto& each) { return std::string(each.param); });

TEST_P(AccelKinds, HitsAreThoseOfTryingEveryTriangle) {
  const api::Device device(2);
  const Geometry g = geometry();
  const api::Accel accel(device, desc_of(g, GetParam()));
  // More than one batch of the library's, so that its own threads take part.
  auto rays = random_rays(20000), expected = rays;
  accel.intersect(rays.data(), rays.size());
  size_t hits = 0;
  for (size_t i = 0; i < rays.size(); ++i) {
    brute_force::intersect(g, expected[i]);
    const bool hit = rays[i].hit.geom_id != LUMICUT_NO_ID;
    ASSERT_EQ(hit, expected[i].hit.geom_id != LUMICUT_NO_ID) << i;
    if (!hit) continue;
    ++hits;
    EXPECT_EQ(rays[i].hit.geom_id, 0u);
    // Single precision, distances of a few units.
    ASSERT_NEAR(rays[i].ray.tfar, expected[i].ray.tfar, 1e-4f * std::max(1.0f, expected[i].ray.tfar)) << i;
  }
  EXPECT_GT(hits, rays.size() / 3);

  auto shadow = random_rays(20000);
  std::vector<lumicut_ray> occluded;
  for (const auto& r : shadow) occluded.push_back(r.ray);
  accel.occluded(occluded.data(), occluded.size());
  for (size_t i = 0; i < occluded.size(); ++i)
    ASSERT_EQ(occluded[i].tfar == -INFINITY, rays[i].hit.geom_id != LUMICUT_NO_ID) << i;
}

TEST_P(AccelKinds, AnswersDoNotDependOnTheSizeOfTheBatch) {
  const api::Device device(2);
  const Geometry g = geometry();
  const api::Accel accel(device, desc_of(g, GetParam()));
  auto whole = random_rays(9000), parts = whole;
  accel.intersect(whole.data(), whole.size());
  for (size_t i = 0; i < parts.size(); i += 7) accel.intersect(parts.data() + i, std::min<size_t>(7, parts.size() - i));
  for (size_t i = 0; i < whole.size(); ++i) {
    EXPECT_EQ(whole[i].ray.tfar, parts[i].ray.tfar);
    EXPECT_EQ(whole[i].hit.prim_id, parts[i].hit.prim_id);
  }
}

TEST_P(AccelKinds, PositionsMayLieInLongerRecords) {
  struct Vertex {
    float position[3], normal[3], uv[2];
  };
  const api::Device device(1);
  const Geometry g = geometry();
  std::vector<Vertex> vertices(g.positions.size() / 3);
  for (size_t i = 0; i < vertices.size(); ++i) std::copy_n(&g.positions[3 * i], 3, vertices[i].position);
  auto d = desc_of(g, GetParam());
  d.positions = vertices[0].position;
  d.position_stride = sizeof(Vertex);
  const api::Accel strided(device, d), packed(device, desc_of(g, GetParam()));
  vertices.assign(vertices.size(), Vertex{});  // inputs are copied
  auto a = random_rays(1000), b = a;
  strided.intersect(a.data(), a.size());
  packed.intersect(b.data(), b.size());
  for (size_t i = 0; i < a.size(); ++i) EXPECT_EQ(a[i].ray.tfar, b[i].ray.tfar);
}

TEST_P(AccelKinds, TellsItsBoundsAndCounts) {
  const api::Device device(1);
  const Geometry g = geometry();
  const auto info = api::Accel(device, desc_of(g, GetParam())).info();
  EXPECT_EQ(info.primitive_count, g.indices.size() / 3);
  EXPECT_FLOAT_EQ(info.lower[0], -1);
  EXPECT_FLOAT_EQ(info.upper[1], 1);
  EXPECT_FLOAT_EQ(info.lower[2], -2);
}

TEST_P(AccelKinds, WithoutTrianglesNothingIsHit) {
  const api::Device device(1);
  auto d = make<lumicut_accel_desc>();
  d.kind = GetParam();
  const api::Accel accel(device, d);
  auto rays = random_rays(10);
  accel.intersect(rays.data(), rays.size());
  for (const auto& r : rays) EXPECT_EQ(r.hit.geom_id, LUMICUT_NO_ID);
}

TEST(Accel, TheBinaryTreeOfTheDefaultKindCanBeWalked) {
  const api::Device device(1);
  const Geometry g = geometry();
  const api::Accel accel(device, desc_of(g, nullptr));
  const auto info = accel.info();
  const size_t triangles = g.indices.size() / 3;
  EXPECT_EQ(info.node_count, 2 * triangles - 1);
  EXPECT_GT(info.expected_cost, 0);
  const uint32_t* ids = nullptr;
  uint64_t count = 0;
  ASSERT_EQ(lumicut_accel_get_primitives(accel.get(), &ids, &count), LUMICUT_OK);
  ASSERT_EQ(count, triangles);
  std::vector<int> seen(triangles, 0);
  std::vector<uint32_t> stack{0};
  while (!stack.empty()) {
    const auto n = accel.node(stack.back());
    stack.pop_back();
    if (n.left == LUMICUT_NO_ID) {
      for (uint32_t i = n.first; i < n.first + n.count; ++i) ++seen[ids[i]];
      continue;
    }
    for (const uint32_t child : {n.left, n.right}) {
      const auto c = accel.node(child);
      for (int k = 0; k < 3; ++k) {
        EXPECT_GE(c.lower[k], n.lower[k]);
        EXPECT_LE(c.upper[k], n.upper[k]);
      }
      stack.push_back(child);
    }
  }
  EXPECT_EQ(seen, std::vector<int>(triangles, 1)) << "each triangle lies in one leaf";
  auto node = make<lumicut_accel_node_info>();
  EXPECT_CODE(lumicut_accel_get_node(accel.get(), info.node_count, &node), LUMICUT_INVALID_ARGUMENT, "is out of range");
}

TEST(Accel, RaysHitBoxesWhereTheyEnter) {
  const api::Device device(1);
  const float boxes[12] = {0, 0, 0, 1, 1, 1, 3, 0, 0, 4, 1, 1};
  auto d = make<lumicut_accel_desc>();
  d.boxes = boxes, d.box_count = 2;
  const api::Accel accel(device, d);
  EXPECT_EQ(accel.info().primitive_count, 2u);
  lumicut_rayhit rays[3] = {};
  const float origins[3][3] = {{-2, 0.5f, 0.5f}, {2, 0.5f, 0.5f}, {-2, 5, 0.5f}};
  for (int i = 0; i < 3; ++i) {
    rays[i].ray = {origins[i][0], origins[i][1], origins[i][2], 0, 1, 0, 0, 0, INFINITY, 0xffffffffu, 0, 0};
    rays[i].hit.geom_id = LUMICUT_NO_ID;
  }
  accel.intersect(rays, 3);
  EXPECT_EQ(rays[0].hit.prim_id, 0u);
  EXPECT_FLOAT_EQ(rays[0].ray.tfar, 2);
  EXPECT_EQ(rays[1].hit.prim_id, 1u);
  EXPECT_FLOAT_EQ(rays[1].ray.tfar, 1);
  EXPECT_EQ(rays[2].hit.geom_id, LUMICUT_NO_ID);
}

TEST(Accel, WrongDescriptorsAreRefused) {
  const api::Device device(1);
  const Geometry g = geometry();
  lumicut_accel accel = nullptr;
  const auto refused = [&](lumicut_accel_desc d, lumicut_result code, const char* text) {
    EXPECT_CODE(lumicut_accel_build(device.get(), &d, &accel), code, text);
    EXPECT_EQ(accel, nullptr);
  };
  auto d = desc_of(g, "octree");
  refused(d, LUMICUT_INVALID_ARGUMENT, "octree");
  d = desc_of(g), d.position_stride = 8;
  refused(d, LUMICUT_INVALID_ARGUMENT, "lumicut_accel_desc.position_stride: 8");
  d = desc_of(g), d.position_count = 3;
  refused(d, LUMICUT_INVALID_ARGUMENT, "is not below position_count 3");
  d = desc_of(g), d.positions = nullptr;
  refused(d, LUMICUT_INVALID_ARGUMENT, "lumicut_accel_desc.positions: is NULL");
  if (lumicut::test::kHasEmbree) {
    d = desc_of(g, "embree"), d.builder = "fast";
    refused(d, LUMICUT_UNSUPPORTED, "lumicut_accel_desc.builder");
  }
  const float box[6] = {0, 0, 0, 1, 1, 1};
  d = make<lumicut_accel_desc>(), d.kind = "embree", d.boxes = box, d.box_count = 1;
  refused(d, LUMICUT_UNSUPPORTED,
          lumicut::test::kHasEmbree ? "lumicut_accel_desc.boxes" : "accel 'embree' is not in this library");
  d = desc_of(g, nullptr), d.builder = "magic";
  refused(d, LUMICUT_INVALID_ARGUMENT, "magic");
  const float inverted[6] = {1, 1, 1, 0, 0, 0};
  d = make<lumicut_accel_desc>(), d.boxes = inverted, d.box_count = 1;
  refused(d, LUMICUT_INVALID_ARGUMENT, "box 0 is inverted");
  d = desc_of(g, nullptr), d.boxes = box, d.box_count = 1;
  refused(d, LUMICUT_INVALID_ARGUMENT, "beside triangles");
  const api::Accel good(device, desc_of(g));
  EXPECT_CODE(lumicut_accel_intersect(good.get(), nullptr, 5), LUMICUT_INVALID_ARGUMENT, "count is 5");
  auto node = make<lumicut_accel_node_info>();
  if (lumicut::test::kHasEmbree) {
    EXPECT_EQ(lumicut_accel_get_node(good.get(), 0, &node), LUMICUT_UNSUPPORTED);
  }
}

}  // namespace
