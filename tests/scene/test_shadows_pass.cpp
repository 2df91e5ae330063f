// Glass that light passes straight, as occlusion queries see it. Fresnel's equations are written out here once more.
#include <gtest/gtest.h>

#include <numbers>

#include "accel/host_accel.h"
#include "tests/support/backends.h"
#include "tests/support/test_scenes.h"
#include "tests/support/trimmed.h"

namespace lumicut {
namespace {

constexpr float kInf = std::numeric_limits<float>::infinity();

// By the angles on both sides. [Fresnel]
double passed_by_fresnel(double cosine, double ior) {
  const double in = std::acos(cosine), out = std::asin(std::sin(in) / ior);
  if (in < 1e-6) return 1 - (ior - 1) * (ior - 1) / ((ior + 1) * (ior + 1));
  const double s = std::sin(in - out) / std::sin(in + out), p = std::tan(in - out) / std::tan(in + out);
  return 1 - 0.5 * (s * s + p * p);
}

Material pane() {
  Material m = test::diffuse(1, 1, 1);
  m.lobe = LobeModel::ggx, m.specular = {1, 1, 1}, m.roughness = 0, m.transmission = 1, m.shadows_pass = true;
  return m;
}

// Where a mesh of one square of the side 2 in the plane z = 0 is placed: as it is, or turned and stretched unevenly.
enum class Place { plain, instanced };

// By powers of two, so that rounding does not move a ray to another cell.
Transform stretched() {
  Transform t;
  const Vec3f columns[4] = {{0, 2, 0}, {0, 0, -0.5f}, {0.125f, 0, 0}, {0.5f, 0.25f, -0.5f}};
  for (int row = 0; row < 3; ++row)
    for (int k = 0; k < 4; ++k) t.m[4 * row + k] = columns[k][row];
  return t;
}

// A host that traces by a BVH which knows no filter.
struct PlainHost {
  explicit PlainHost(AccelGeometry geometry) {
    geometry.filter = nullptr;
    inner = make_accel("bvh", geometry, {});
  }
  static void intersect(void* user, RayHit* rays, size_t n) {
    static_cast<PlainHost*>(user)->inner->intersect({rays, n});
  }
  static void occluded(void* user, Ray* rays, size_t n) { static_cast<PlainHost*>(user)->inner->occluded({rays, n}); }
  std::unique_ptr<Accel> inner;
};

struct Square {
  Square(const std::string& backend, Place place, const Material& material, bool robust = true)
      : scene(Scene::Config{backend == "host" ? "bvh" : backend, robust}) {
    scene.set_materials({material});
    Mesh mesh;
    test::add_quad(mesh, {-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}, 0);
    if (place == Place::instanced) {
      to_world = stretched();
      mesh.instances = {Transform{}, to_world};
      mesh.instances[0].m[3] = 100;  // elsewhere, so that numbers of instances matter
    }
    scene.add_mesh(std::move(mesh));
    if (backend == "host")
      scene.set_trace([this](const AccelGeometry& geometry) {
        host = std::make_unique<PlainHost>(geometry);
        return make_host_accel({PlainHost::intersect, PlainHost::occluded, host.get()}, geometry);
      });
    Progress progress;
    scene.commit(progress);
  }

  // A ray through the square that meets it at this cosine in the middle of a cell of the chance, where rounding does not
  // matter.
  Ray ray(float cosine, Rng& rng) const {
    const auto share = [&] { return (std::floor(rng.next_float() * 0.48f * 0x1p20f) + 0.5f) * 0x1p-20f; };
    const float u = share(), v = share();
    // Of the first triangle: (−1, −1), (1, −1), (1, 1).
    const Vec3f place = to_world.point({-1 + 2 * u + 2 * v, -1 + 2 * v, 0});
    const Frame frame(normalize(to_world.normal({0, 0, 1})));
    const float phi = 6.2831853f * rng.next_float(), sine = std::sqrt(1 - cosine * cosine);
    const Vec3f towards = frame.to_world({sine * std::cos(phi), sine * std::sin(phi), cosine});
    const float side = rng.next_float() < 0.5f ? 1.0f : -1.0f;
    Ray r;
    r.org = place + towards * (0.5f * side), r.dir = towards * (-2.0f * side), r.tfar = 0.9f;
    return r;
  }

  std::unique_ptr<PlainHost> host;
  Transform to_world;
  Scene scene;
};

std::vector<uint8_t> stopped(const Scene& scene, std::vector<Ray> rays) {
  scene.accel().occluded(rays);
  std::vector<uint8_t> out;
  for (const Ray& r : rays) out.push_back(r.tfar == -kInf);
  return out;
}

// The same rays by the hot call: each by itself, with others around it that share its origin, or its direction.
std::vector<uint8_t> stopped_in_bundles(const Scene& scene, const std::vector<Ray>& rays, bool directional) {
  std::vector<uint8_t> out;
  for (const Ray& r : rays) {
    constexpr size_t kCount = 16;
    float x[kCount], y[kCount], z[kCount];
    uint8_t occluded[kCount];
    for (size_t i = 0; i < kCount; ++i) {
      const Vec3f shift = Vec3f{1, 1, 1} * (1e-3f * static_cast<float>(i));
      const Vec3f p = (directional ? r.org : r.org + r.dir * r.tfar) + shift;
      x[i] = p.x, y[i] = p.y, z[i] = p.z;
    }
    scene.accel().occluded_from_point({directional ? normalize(r.dir) : r.org, directional}, x, y, z, kCount, occluded);
    out.push_back(occluded[0]);
  }
  return out;
}

double share_passed(const std::vector<uint8_t>& stopped) {
  double passed = 0;
  for (const uint8_t s : stopped) passed += s == 0;
  return passed / static_cast<double>(stopped.size());
}

size_t differing(const std::vector<uint8_t>& a, const std::vector<uint8_t>& b) {
  size_t count = 0;
  for (size_t i = 0; i < a.size(); ++i) count += a[i] != b[i];
  return count;
}

class ShadowsPass : public testing::TestWithParam<std::tuple<const char*, Place>> {};
INSTANTIATE_TEST_SUITE_P(Backends, ShadowsPass,
                         testing::Combine(testing::ValuesIn([] {
                                            auto all = test::backends();
                                            all.push_back("host");
                                            return all;
                                          }()),
                                          testing::Values(Place::plain, Place::instanced)));

TEST_P(ShadowsPass, ByFresnelsEquationsFromEitherSide) {
  const auto [backend, place] = GetParam();
  const Square square(backend, place, pane());
  Rng rng(3, Stage::test);
  constexpr size_t kRays = test::trimmed(40000);
  for (const float cosine : {1.0f, 0.8f, 0.5f, 0.3f, 0.15f}) {
    std::vector<Ray> rays;
    for (size_t i = 0; i < kRays; ++i) rays.push_back(square.ray(cosine, rng));
    const double expected = passed_by_fresnel(cosine, 1.5);
    const double noise = 4 * std::sqrt(expected * (1 - expected) / kRays);
    EXPECT_NEAR(share_passed(stopped(square.scene, rays)), expected, noise) << cosine;
    rays.resize(kRays / 10);
    for (const bool directional : {false, true})
      EXPECT_NEAR(share_passed(stopped_in_bundles(square.scene, rays, directional)), expected, 3.2 * noise) << cosine;
    // Other rays meet it always.
    std::vector<RayHit> hits;
    for (const Ray& r : rays) hits.push_back({r, {}});
    square.scene.accel().intersect(hits);
    for (const RayHit& h : hits) ASSERT_EQ(h.hit.geom, 0u);
  }
}

TEST_P(ShadowsPass, TheSameRaysWithEveryBackend) {
  const auto [backend, place] = GetParam();
  Rng rng(4, Stage::test);
  for (const bool robust : {true, false}) {
    const Square bvh("bvh", place, pane(), robust), other(backend, place, pane(), robust);
    std::vector<Ray> rays;
    for (size_t i = 0; i < test::trimmed(20000); ++i) rays.push_back(bvh.ray(0.1f + 0.9f * rng.next_float(), rng));
    const auto expected = stopped(bvh.scene, rays);
    EXPECT_EQ(differing(stopped(other.scene, rays), expected), 0u);
    EXPECT_EQ(differing(stopped_in_bundles(other.scene, rays, false), expected), 0u) << "to points";
    EXPECT_EQ(differing(stopped_in_bundles(other.scene, rays, true), expected), 0u) << "to a distant light";
  }
}

// What lies behind an open surface lies inside the glass, where light of the other side comes in a narrower cone.
TEST_P(ShadowsPass, ThroughOpenGlassLessByTheSquareOfTheIndexForWhatIsBehindIt) {
  const auto [backend, place] = GetParam();
  Material open = pane();
  open.open_glass = true;
  const Square square(backend, place, open);
  const Vec3f normal = normalize(square.to_world.normal({0, 0, 1}));
  constexpr float kCosine = 0.5f;
  constexpr size_t kRays = test::trimmed(20000);
  const double whole = passed_by_fresnel(kCosine, 1.5), noise = 4 * std::sqrt(0.25 / kRays);
  for (const bool lit_behind : {false, true}) {
    const double expected = lit_behind ? whole / (1.5 * 1.5) : whole;
    Rng rng(7, Stage::test);
    std::vector<Ray> from_lights, to_lights;
    while (from_lights.size() < kRays) {
      Ray r = square.ray(kCosine, rng);
      if ((dot(r.dir, normal) < 0) != lit_behind) continue;
      r.flags = kFromLight;
      from_lights.push_back(r);
      r.org = r.org + r.dir * r.tfar, r.dir = -r.dir, r.flags = 0;
      to_lights.push_back(r);
    }
    EXPECT_NEAR(share_passed(stopped(square.scene, from_lights)), expected, noise);
    EXPECT_NEAR(share_passed(stopped(square.scene, to_lights)), expected, noise);
    from_lights.resize(kRays / 10), to_lights.resize(kRays / 10);
    EXPECT_NEAR(share_passed(stopped_in_bundles(square.scene, from_lights, false)), expected, 3.2 * noise);
    EXPECT_NEAR(share_passed(stopped_in_bundles(square.scene, to_lights, true)), expected, 3.2 * noise);
  }
}

TEST(ShadowsPass, DimmedByColourOpacityAndTheShareOfGlass) {
  constexpr size_t kRays = test::trimmed(40000);
  const auto passed = [&](const Material& m) {
    const Square square("bvh", Place::plain, m);
    Rng rng(5, Stage::test);
    std::vector<Ray> rays;
    for (size_t i = 0; i < kRays; ++i) rays.push_back(square.ray(0.8f, rng));
    return share_passed(stopped(square.scene, rays));
  };
  const double clear = passed_by_fresnel(0.8, 1.5), noise = 4 * std::sqrt(0.25 / kRays);
  Material m = pane();
  m.diffuse = {0.16f, 0.64f, 0.36f};  // of two borders
  EXPECT_NEAR(passed(m), clear * (0.2126 * 0.4 + 0.7152 * 0.8 + 0.0722 * 0.6), noise);
  m = pane(), m.transmission = 0.5f;
  EXPECT_NEAR(passed(m), 0.5 * clear, noise);
  m = pane(), m.metallic = 0.25f;
  EXPECT_NEAR(passed(m), 0.75 * clear, noise);
  m = pane(), m.opacity = 0.5f;
  EXPECT_NEAR(passed(m), 1 - 0.5 * (1 - clear), noise);
  m = pane(), m.ior = 1.0f;
  EXPECT_EQ(passed(m), 1.0);
  m = pane(), m.shadows_pass = false;
  EXPECT_EQ(passed(m), 0.0);
  // Rough glass: what of even light its facets let through in all, which is near to what smooth glass does.
  m = pane(), m.roughness = 0.1f;
  EXPECT_NEAR(passed(m), clear, 0.01 + noise);
  m.roughness = 0.8f;
  EXPECT_NEAR(passed(m), clear, 0.15);
  EXPECT_LT(passed(m), 1.0);
}

TEST(ShadowsPass, ColoursOfBordersMultiplyChannelByChannel) {
  Scene scene(Scene::Config{"bvh", true});
  Material m = pane();
  m.ior = 1.0f, m.diffuse = {0.81f, 0.04f, 0.01f};
  scene.set_materials({m});
  Mesh mesh;
  for (const float z : {0.0f, -0.3f, -0.7f}) test::add_quad(mesh, {-9, -9, z}, {9, -9, z}, {9, 9, z}, {-9, 9, z}, 0);
  scene.add_mesh(std::move(mesh));
  Progress progress;
  scene.commit(progress);
  Rng rng(6, Stage::test);
  constexpr size_t kRays = test::trimmed(40000);
  for (const bool parallel : {false, true}) {
    std::vector<Ray> rays(kRays);
    for (Ray& r : rays) {
      const Vec3f place{rng.next_float(), rng.next_float(), -1};
      r.org = parallel ? place + Vec3f{0.5f, 0.2f, 2} : Vec3f{0.5f, 0.2f, 1};
      r.dir = place - r.org, r.tfar = 1;
    }
    const double expected = 0.2126 * std::pow(0.9, 3) + 0.7152 * std::pow(0.2, 3) + 0.0722 * std::pow(0.1, 3);
    EXPECT_NEAR(share_passed(stopped(scene, rays)), expected, 4 * std::sqrt(0.25 / kRays)) << parallel;
  }
}

TEST(ShadowsPass, ButForSurfacesBehindTheGlass) {
  for (const char* backend : test::backends()) {
    Scene scene(Scene::Config{backend, true});
    Material clear = pane();
    clear.ior = 1.0f;
    scene.set_materials({clear, test::diffuse(0.5f, 0.5f, 0.5f)});
    Mesh mesh;
    test::add_quad(mesh, {-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}, 0);
    test::add_quad(mesh, {-1, -1, -1}, {0, -1, -1}, {0, 1, -1}, {-1, 1, -1}, 1);
    scene.add_mesh(std::move(mesh));
    Progress progress;
    scene.commit(progress);
    float x[64], y[64], z[64];
    uint8_t occluded[64];
    for (int i = 0; i < 64; ++i) x[i] = (i % 2 != 0 ? 0.5f : -0.5f), y[i] = 0.01f * static_cast<float>(i), z[i] = -2;
    scene.accel().occluded_from_point({{0, 0, 1e6f}, false}, x, y, z, 64, occluded);
    for (int i = 0; i < 64; ++i) EXPECT_EQ(occluded[i], i % 2 != 0 ? 0 : 1) << backend;
    scene.accel().occluded_from_point({{0, 0, 1}, true}, x, y, z, 64, occluded);
    for (int i = 0; i < 64; ++i) EXPECT_EQ(occluded[i], i % 2 != 0 ? 0 : 1) << backend;
  }
}

}  // namespace
}  // namespace lumicut
