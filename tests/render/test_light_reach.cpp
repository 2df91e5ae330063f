// Lamps that not all lobes and meshes see, and worlds.
#include <gtest/gtest.h>

#include "integrators/traits.h"
#include "tests/support/render.h"

namespace lumicut {
namespace {

constexpr uint32_t kWidth = 24, kHeight = 18;
constexpr uint32_t kLit = kDiffuseRay | kGlossyRay | kTransmissionRay;

// A floor of two halves, the left one diffuse, the right one of `right`, below a lamp, with a box on each.
std::unique_ptr<Scene> floor(const Light& lamp, const Material& right, const std::function<void(Scene&)>& more = {}) {
  auto scene = std::make_unique<Scene>(Scene::Config{});
  scene->set_materials({test::diffuse(0.6f, 0.6f, 0.6f), right});
  for (const float x : {-1.0f, 0.0f}) {
    Mesh half;
    test::add_quad(half, {x, -1, -1}, {x + 1, -1, -1}, {x + 1, 1, -1}, {x, 1, -1}, x < 0 ? 0 : 1);
    scene->add_mesh(std::move(half));
    Mesh box;
    test::add_box(box, {x + 0.4f, 0.2f, -1}, {x + 0.6f, 0.4f, -0.5f}, 0, false);
    scene->add_mesh(std::move(box));
  }
  scene->set_lights({lamp});
  if (more) more(*scene);
  test::commit_seen_from(*scene, {0, -2.2f, 0}, 1.4f);
  return scene;
}

Light panel(uint32_t seen_by = kLit) {
  Light l;
  l.type = LightType::rectangle, l.value = {5, 5, 5};
  l.position = {0, 0, 1}, l.u = {0.5f, 0, 0}, l.v = {0, -0.5f, 0};
  l.reach.seen_by = seen_by;
  return l;
}
Light bulb(uint32_t seen_by = kLit) {
  Light l;
  l.value = {2, 2, 2}, l.position = {0, 0, 1};
  l.reach.seen_by = seen_by;
  return l;
}
Material gloss() {
  Material m = test::diffuse(0.4f, 0.4f, 0.4f);
  m.lobe = LobeModel::ggx, m.roughness = 0.6f, m.specular = {0.5f, 0.5f, 0.5f}, m.fresnel = false;
  return m;
}

std::vector<Rgb> render(const Scene& scene, const std::string& id = "exhaustive", test::Settings settings = {}) {
  const IntegratorEntry* entry = find_integrator(id);
  Preparation preparation(*entry);
  settings.emplace_back("vpls", "600");
  if (id == "path_tracer") settings = {{"samples", "400"}};
  for (const auto& [name, value] : settings) preparation.params.set(name, value);
  const FrameOptions frame = test::frame_of({.width = kWidth, .height = kHeight});
  RenderLoop loop(preparation, scene, nullptr, frame, {}, {});
  Progress progress;
  Stats stats;
  Arena(0).run([&] { loop.run(progress, stats, [](const Rect&) {}); });
  std::vector<Rgb> out(kWidth * kHeight);
  loop.read([&](const Film& film) { film.read(Channel::radiance, frame.crop, &out[0].x); });
  return out;
}

double mean(const std::vector<Rgb>& image) { return test::mean_luminance(image); }

void expect_sum(const std::vector<Rgb>& a, const std::vector<Rgb>& b, const std::vector<Rgb>& whole, float tolerance) {
  for (size_t i = 0; i < whole.size(); ++i)
    EXPECT_NEAR(a[i].x + b[i].x, whole[i].x, tolerance * (0.02f + whole[i].x)) << i;
}

// Direct light, of which each lobe shows its own part.
TEST(LightReach, LobesLitApartSumToTheWhole) {
  for (const auto& lamp : {panel, bulb})
    for (const auto& [settings, tolerance] :
         {std::pair{test::Settings{{"max_depth", "0"}}, 1e-4f}, {{{"max_depth", "0"}, {"error", "0.0001"}}, 2e-3f}}) {
      const std::string id = settings.size() > 1 ? "lightcuts" : "exhaustive";
      const auto lit = [&, &s = settings](uint32_t seen_by) { return render(*floor(lamp(seen_by), gloss()), id, s); };
      expect_sum(lit(kDiffuseRay), lit(kGlossyRay), lit(kLit), tolerance);
    }
}

TEST(LightReach, NothingShowsWhatNoneOfItsLobesSees) {
  const Material mirror = [] {
    Material m = test::diffuse(0.9f, 0.9f, 0.9f);
    m.lobe = LobeModel::ggx, m.metallic = 1, m.roughness = 0, m.specular = {1, 1, 1};
    return m;
  }();
  Light far = panel(kGlossyRay);  // where the mirror shows it to the camera
  far.position = {0.5f, 6, 1}, far.u = {1, 0, 0}, far.v = {0, -1, 0};
  for (const char* id : {"exhaustive", "path_tracer"}) {
    const auto image = render(*floor(far, mirror), id);
    EXPECT_GT(mean(image), 0) << id << ": its mirror image";
    for (size_t y = 0; y < kHeight; ++y) EXPECT_EQ(image[y * kWidth + 6], Rgb{}) << id << ": diffuse, row " << y;
    far.reach.seen_by = kTransmissionRay;
    EXPECT_EQ(mean(render(*floor(far, mirror), id)), 0) << id;
    far.reach.seen_by = kGlossyRay;
    EXPECT_EQ(mean(render(*floor(far, test::diffuse(0.5f, 0.5f, 0.5f)), id)), 0) << id;
  }
}

// The same scene by virtual lights and by paths; the lamp's own lobe decides at the first surface alone.
TEST(LightReach, VirtualLightsAndPathsAgree) {
  for (const uint32_t seen_by : {uint32_t{kDiffuseRay}, uint32_t{kGlossyRay}}) {
    const auto scene = floor(panel(seen_by), gloss());
    const double paths = mean(render(*scene, "path_tracer"));
    double lights = 0;
    for (const char* seed : {"1", "2", "3", "4"})
      lights += mean(render(*scene, "exhaustive", {{"compensate", "1"}, {"seed", seed}, {"vpls", "2000"}})) / 4;
    EXPECT_NEAR(lights / paths, 1, 0.03) << seen_by;
  }
}

TEST(LightReach, LinkedLampsLightTheirReceiversAloneAndThoseLightAll) {
  Light lamp = bulb();
  lamp.reach.receivers = 3;
  const auto scene_of = [&](const Light& l, uint32_t not_lit_by) {
    return floor(l, test::diffuse(0.6f, 0.6f, 0.6f), [&](Scene& scene) {
      Mesh wall;  // that is no receiver
      test::add_quad(wall, {-1, 1, -1}, {1, 1, -1}, {1, 1, 1}, {-1, 1, 1}, 0);
      wall.not_lit_by = not_lit_by;
      scene.add_mesh(std::move(wall));
    });
  };
  const auto wall_of = [](const std::vector<Rgb>& image) { return luminance(image[9 * kWidth + kWidth / 2]); };
  for (const char* id : {"exhaustive", "path_tracer"}) {
    const auto unlit = render(*scene_of(lamp, 4), id), lit = render(*scene_of(lamp, 3), id),
               all = render(*scene_of(bulb(), 4), id);
    EXPECT_LT(wall_of(unlit), 0.5 * wall_of(lit)) << id;
    EXPECT_GT(wall_of(unlit), 0.01 * wall_of(lit)) << id << ": by the floor";
    EXPECT_NEAR(mean(lit) / mean(all), 1, 1e-5) << id << ": of other sets it may be none";
  }
}

TEST(LightReach, WhatIsNoBlockerThrowsNoShadow) {
  Light lamp = bulb();
  lamp.reach.blockers = 2;
  lamp.position = {-1, 0.3f, 0.2f};
  const auto scene = [&](uint32_t not_blocking) {
    return floor(lamp, test::diffuse(0.6f, 0.6f, 0.6f), [&](Scene& s) {
      Mesh wall;  // between lamp and right half
      test::add_quad(wall, {-0.1f, -1, -1}, {-0.1f, 1, -1}, {-0.1f, 1, 1}, {-0.1f, -1, 1}, 0);
      wall.mask = kShadowRay;
      wall.not_blocking = not_blocking;
      s.add_mesh(std::move(wall));
    });
  };
  const auto right_of = [](const std::vector<Rgb>& image) { return luminance(image[12 * kWidth + 13]); };
  for (const char* id : {"exhaustive", "path_tracer"}) {
    EXPECT_GT(right_of(render(*scene(2), id)), 0.01) << id;
    EXPECT_LT(right_of(render(*scene(1), id)), 0.2 * right_of(render(*scene(2), id))) << id;
  }
}

// Light paths went through such a pane twice, as one that it does not stop and as one that glass lets pass; or ended there.
TEST(LightReach, BouncedLightPassesGlassThatIsNoBlockerOrNoReceiverOnce) {
  Material closed = test::diffuse(1, 1, 1);
  closed.lobe = LobeModel::ggx, closed.specular = {1, 1, 1}, closed.roughness = 0, closed.transmission = 1;
  closed.shadows_pass = true;
  Material open = closed;
  open.open_glass = true;
  for (const Material& glass : {closed, open})
    for (const auto& [blockers, receivers] : {std::pair{2u, 0u}, {0u, 3u}}) {
      Scene scene{Scene::Config{}};  // a room beneath a pane, and the lamp above it
      scene.set_materials({test::diffuse(0.7f, 0.7f, 0.7f), glass});
      Mesh room, pane;
      test::add_box(room, {-1, -1, -1}, {1, 1, 1}, 0, true);
      test::add_quad(pane, {-1, -1, 0.6f}, {1, -1, 0.6f}, {1, 1, 0.6f}, {-1, 1, 0.6f}, 1);
      pane.not_blocking = 2, pane.not_lit_by = 4;
      scene.add_mesh(std::move(room)), scene.add_mesh(std::move(pane));
      Light lamp = panel();
      lamp.position = {0, 0, 0.9f}, lamp.reach.blockers = blockers, lamp.reach.receivers = receivers;
      scene.set_lights({lamp});
      test::commit_seen_from(scene, {0, -0.9f, -0.2f}, 1.0f);
      const double paths = mean(render(scene, "path_tracer"));
      double lights = 0;
      for (const char* seed : {"1", "2", "3", "4", "5", "6", "7", "8"})
        lights += mean(render(scene, "exhaustive", {{"compensate", "1"}, {"seed", seed}})) / 8;
      EXPECT_NEAR(lights / paths, 1, 0.05) << blockers << " " << glass.open_glass;
    }
}

TEST(LightReach, EveryMethodKnowsIt) {
  for (const IntegratorEntry& entry : integrators()) {
    const double dark = mean(render(*floor(bulb(kGlossyRay), test::diffuse(0.5f, 0.5f, 0.5f)), entry.id));
    EXPECT_EQ(dark, 0) << entry.id;
  }
}

// Over what lies behind it, by its radiance, from the front.
TEST(LightReach, TheCameraSeesLampsThatItShall) {
  Light lamp = panel(kLit | kCameraRay);
  lamp.position = {0, 1, 0}, lamp.u = {0.6f, 0, 0}, lamp.v = {0, 0, 0.6f};  // u × v: towards the camera
  const auto image = render(*floor(lamp, gloss()));
  lamp.reach.seen_by = kLit;
  const auto without = render(*floor(lamp, gloss()));
  size_t seen = 0;
  for (size_t i = 0; i < image.size(); ++i)
    if (image[i] != without[i]) {
      ++seen;
      EXPECT_NEAR(image[i].x - without[i].x, 5, 1e-3);
    }
  EXPECT_GE(seen, 4u);
  Light ball = bulb(kLit | kCameraRay);
  ball.position = {0, 1, 0}, ball.radius = 0.5f;
  for (const bool facing : {false, true}) {
    ball.facing = facing;
    const auto balls = render(*floor(ball, gloss()));
    EXPECT_NEAR(std::max_element(balls.begin(), balls.end(), [](Rgb a, Rgb b) { return a.x < b.x; })->x,
                2 / (M_PI * 0.25), 0.4);
  }
}

// As the camera itself sees none of them, and samples of lights mean nothing to a mirror, nothing else would show them.
TEST(LightReach, MirrorsShowLampsAndSunsWithARadius) {
  Material mirror = test::diffuse(1, 1, 1);  // the colour of a metal
  mirror.lobe = LobeModel::ggx, mirror.specular = {1, 1, 1}, mirror.metallic = 1, mirror.roughness = 0;
  const Vec3f up = normalize(Vec3f{0.2f, 1.9f, 1});  // where the camera's rays go that meet the right half's front
  Light ball;
  ball.value = {2, 2, 2}, ball.position = Vec3f{0.2f, -0.3f, -1} + up * 3.0f, ball.radius = 0.4f;
  Light sun;
  sun.type = LightType::sun, sun.value = {1, 1, 1}, sun.direction = -up, sun.radius = 0.15f;
  const double of_ball = 2 / (M_PI * 0.16), of_sun = 1 / (2 * M_PI * (1 - std::cos(0.15)));
  for (const auto& [lamp, radiance] : {std::pair{ball, of_ball}, {sun, of_sun}})
    for (const char* id : {"exhaustive", "path_tracer"}) {
      const auto most = [&, lit = lamp](uint32_t seen_by) {
        Light shown = lit;
        shown.reach.seen_by = seen_by;
        const auto image = render(*floor(shown, mirror), id);
        return double{std::max_element(image.begin(), image.end(), [](Rgb a, Rgb b) { return a.x < b.x; })->x};
      };
      EXPECT_NEAR(most(kLit), radiance, 1e-3 * radiance) << id;
      EXPECT_LT(most(kDiffuseRay), 0.5 * radiance) << id;
    }
}

// Not one pixel in ten, as bright as the lamp itself.
TEST(LightReach, LacquerAndGlassShowLampsAsFresnelHasIt) {
  Material lacquer = test::diffuse(0.1f, 0.1f, 0.1f);
  lacquer.lobe = LobeModel::ggx, lacquer.specular = {}, lacquer.coat = 1, lacquer.coat_roughness = 0;
  Material glass = test::diffuse(1, 1, 1);
  glass.lobe = LobeModel::ggx, glass.specular = {1, 1, 1}, glass.roughness = 0, glass.transmission = 1;
  const Vec3f up = normalize(Vec3f{0.2f, 1.9f, 1});
  Light sun;
  sun.type = LightType::sun, sun.value = {1, 1, 1}, sun.direction = -up, sun.radius = 0.15f;
  const double radiance = 1 / (2 * M_PI * (1 - std::cos(0.15)));
  for (const auto& [material, ior] : {std::pair{lacquer, lacquer.coat_ior}, {glass, glass.ior}})
    for (const char* id : {"exhaustive", "path_tracer"}) {
      const auto image = render(*floor(sun, material), id);
      float refracted = 0;
      // Over the sun's disc the share falls with the height by up to a half.
      const double share = fresnel_reflectance(up.z, ior, refracted);
      const double most = std::max_element(image.begin(), image.end(), [](Rgb a, Rgb b) { return a.x < b.x; })->x;
      EXPECT_GT(most, share * radiance) << id;
      EXPECT_LT(most, 2 * share * radiance) << id;
    }
}

TEST(LightReach, WorldsAreSeenByKindsOfRays) {
  const auto lit = [](uint32_t seen_by, const Material& right, const char* id) {
    return render(*floor(bulb(0), right,
                         [&](Scene& scene) {
                           Environment e;
                           e.color = {1, 1, 1}, e.hidden = true, e.reach.seen_by = seen_by;
                           scene.set_environment(e);
                         }),
                  id);
  };
  for (const char* id : {"exhaustive", "path_tracer"}) {
    EXPECT_GT(mean(lit(kDiffuseRay, test::diffuse(0.5f, 0.5f, 0.5f), id)), 0.01) << id;
    EXPECT_EQ(mean(lit(kGlossyRay | kTransmissionRay, test::diffuse(0.5f, 0.5f, 0.5f), id)), 0) << id;
    EXPECT_GT(mean(lit(kGlossyRay, gloss(), id)), 0.002) << id;
  }
}

}  // namespace
}  // namespace lumicut
