// What denoising takes of a render: features seen through mirrors and glass, and the residual.
#include <gtest/gtest.h>

#include "tests/support/render.h"

namespace lumicut {
namespace {

constexpr uint32_t kWidth = 24, kHeight = 18;

// A closed white room, whose right wall is green, with a panel before the back wall.
std::unique_ptr<Scene> room(const Material& panel, uint32_t green_mask = 0xffffffffu) {
  auto scene = std::make_unique<Scene>(Scene::Config{"bvh", true});
  Material glowing = test::diffuse(0, 0, 0);
  glowing.emission = {6, 6, 6};
  scene->set_materials({test::diffuse(0.6f, 0.6f, 0.6f), panel, test::diffuse(0.1f, 0.5f, 0.2f), glowing});
  Mesh mesh;
  test::add_box(mesh, {-1, -1, -1}, {1, 1, 1}, 0, true);
  test::add_quad(mesh, {-0.3f, 0.3f, 0.98f}, {0.3f, 0.3f, 0.98f}, {0.3f, -0.3f, 0.98f}, {-0.3f, -0.3f, 0.98f}, 3);
  scene->add_mesh(std::move(mesh));
  Mesh before;  // the back wall
  test::add_quad(before, {-0.99f, 0.9f, -0.99f}, {0.99f, 0.9f, -0.99f}, {0.99f, 0.9f, 0.99f}, {-0.99f, 0.9f, 0.99f}, 1);
  scene->add_mesh(std::move(before));
  Mesh behind;  // the camera
  test::add_quad(behind, {-0.99f, -0.97f, -0.99f}, {-0.99f, -0.97f, 0.99f}, {0.99f, -0.97f, 0.99f},
                 {0.99f, -0.97f, -0.99f}, 2);
  behind.mask = green_mask;
  scene->add_mesh(std::move(behind));
  test::commit_seen_from(*scene, {0, -0.95f, 0.1f}, 0.3f);
  return scene;
}

Material mirror() {
  Material m = test::diffuse(0.9f, 0.9f, 0.9f);
  m.lobe = LobeModel::ggx, m.metallic = 1, m.roughness = 0, m.specular = {1, 1, 1};
  return m;
}
Material glass() {
  Material m = test::diffuse(1, 1, 1);
  m.lobe = LobeModel::ggx, m.specular = {1, 1, 1}, m.roughness = 0, m.transmission = 1;
  return m;
}

struct Features {
  Rgb albedo;
  Vec3f normal;
  float depth;
};

template <typename Fn>
void render(const Scene& scene, bool denoise, IterationOptions iterations, Fn&& look,
            const std::string& id = "lightcuts") {
  Preparation preparation(*find_integrator(id));
  if (id != "path_tracer") preparation.params.set("vpls", "200"), preparation.params.set("compensate", "true");
  FrameOptions frame = test::frame_of({.width = kWidth, .height = kHeight});
  frame.denoise = denoise;
  RenderLoop loop(preparation, scene, nullptr, frame, std::move(iterations), {});
  Progress progress;
  Stats stats;
  Arena(2).run([&] { loop.run(progress, stats, [](const Rect&) {}); });
  loop.read([&](const Film& film) { look(film, loop); });
}

Features in_the_middle(const Scene& scene) {
  Features f{};
  render(scene, true, {}, [&](const Film& film, const RenderLoop&) {
    const auto rgb = [&](Channel c) {
      const float* p = film.pixel(c, kWidth / 2, kHeight / 2);
      return Vec3f{p[0], p[1], p[2]};
    };
    f = {rgb(Channel::denoising_albedo), rgb(Channel::denoising_normal),
         *film.pixel(Channel::denoising_depth, kWidth / 2, kHeight / 2)};
  });
  return f;
}

void expect_near(const Vec3f& a, const Vec3f& b, float tolerance = 1e-3f) {
  EXPECT_LT(length(a - b), tolerance) << a.x << " " << a.y << " " << a.z;
}

TEST(DenoisingFeatures, AMatteSurfaceShowsItself) {
  const Features f = in_the_middle(*room(test::diffuse(0.3f, 0.2f, 0.1f)));
  expect_near(f.albedo, {0.3f, 0.2f, 0.1f});
  expect_near(f.normal, {0, -1, 0});
  EXPECT_NEAR(f.depth, 1.85f, 1e-3f);
}

TEST(DenoisingFeatures, AMirrorShowsWhatIsSeenInIt) {
  const Features f = in_the_middle(*room(mirror()));
  expect_near(f.albedo, Rgb{0.1f, 0.5f, 0.2f} * 0.9f, 0.02f);  // Fresnel's little more at an angle
  expect_near(f.normal, {0, 1, 0});
  EXPECT_NEAR(f.depth, 1.85f + 1.87f, 1e-3f);
}

TEST(DenoisingFeatures, AMirrorShowsWhatGlossyRaysSee) {
  // The wall 3 cm behind what is hidden.
  const Features f = in_the_middle(*room(mirror(), kAllRays & ~kGlossyRay));
  expect_near(f.albedo, Rgb{0.6f, 0.6f, 0.6f} * 0.9f, 0.03f);
  EXPECT_NEAR(f.depth, 1.85f + 1.9f, 1e-3f);
}

TEST(DenoisingFeatures, GlassShowsWhatIsBehind) {
  const Features f = in_the_middle(*room(glass()));
  expect_near(f.albedo, {0.6f, 0.6f, 0.6f}, 0.03f);
  expect_near(f.normal, {0, -1, 0});
  EXPECT_NEAR(f.depth, 1.95f, 1e-3f);
}

// The same lights shine on all points that are seen in it, so that there is nothing to filter.
TEST(Residual, OfWhatAMirrorShowsIsNoMoreThanOfWhatIsSeen) {
  const auto share = [](const Material& panel) {
    double residual = 0, radiance = 0;
    render(*room(panel), true, {}, [&](const Film& film, const RenderLoop&) {
      for (uint32_t y = 6; y < 12; ++y)
        for (uint32_t x = 8; x < 16; ++x)
          residual += *film.pixel(Channel::residual, x, y), radiance += *film.pixel(Channel::radiance, x, y);
    });
    return residual / radiance;
  };
  const double seen = share(test::diffuse(0.6f, 0.6f, 0.6f));
  EXPECT_LT(seen, 0.3);
  EXPECT_LT(share(mirror()), 0.3);
}

bool same(const Film& a, const Film& b, Channel c) {
  const size_t count = channel_table()[static_cast<size_t>(c)].components * size_t{kWidth} * kHeight;
  std::vector<float> x(count), y(count);
  a.read(c, a.crop(), x.data()), b.read(c, b.crop(), y.data());
  return x == y;
}

TEST(Denoising, OtherChannelsStayBitForBit) {
  const auto scene = test::make_room();
  for (const uint32_t count : {1u, 4u})
    for (const char* id : {"lightcuts", "path_tracer"}) {
      IterationOptions iterations;
      iterations.count = count;
      render(
          *scene, false, iterations,
          [&](const Film& without, const RenderLoop&) {
            render(
                *scene, true, iterations,
                [&](const Film& with, const RenderLoop&) {
                  for (const ChannelInfo& c : channel_table()) {
                    if (of_denoising(c.channel)) continue;
                    EXPECT_TRUE(same(with, without, c.channel)) << id << " " << c.name;
                  }
                },
                id);
          },
          id);
    }
}

TEST(Denoising, TheResidualIsPartOfTheRadianceAndAllOfAPathTracers) {
  const auto scene = test::make_room();
  IterationOptions iterations;
  iterations.count = 4;
  for (const char* id : {"lightcuts", "path_tracer"})
    render(
        *scene, true, iterations,
        [&](const Film& film, const RenderLoop&) {
          double residual = 0, radiance = 0;
          for (uint32_t y = 0; y < kHeight; ++y)
            for (uint32_t x = 0; x < kWidth; ++x)
              for (int k = 0; k < 3; ++k) {
                const float part = film.pixel(Channel::residual, x, y)[k], all = film.pixel(Channel::radiance, x, y)[k];
                EXPECT_LE(part, all * 1.0001f + 1e-6f);
                residual += static_cast<double>(part), radiance += static_cast<double>(all);
              }
          if (std::string(id) == "path_tracer")
            EXPECT_NEAR(residual / radiance, 1, 1e-5);  // nothing here glows towards the camera
          else
            EXPECT_LT(residual / radiance, 0.4);
        },
        id);
}

TEST(Denoising, ARenderThatGoesOnIsTheUnbrokenOne) {
  const auto scene = test::make_room();
  IterationOptions unbroken, first, rest;
  unbroken.count = rest.count = 5, first.count = 3, first.checkpoints = true;
  render(*scene, true, first, [&](const Film&, const RenderLoop& loop) { rest.resume = *loop.state().checkpoint; });
  render(*scene, true, unbroken, [&](const Film& a, const RenderLoop&) {
    render(*scene, true, rest, [&](const Film& b, const RenderLoop&) {
      for (const ChannelInfo& c : channel_table()) EXPECT_TRUE(same(a, b, c.channel)) << c.name;
    });
  });
  // One that holds all gives what it gave.
  first.count = 5;
  render(*scene, true, first, [&](const Film& a, const RenderLoop& loop) {
    rest.resume = *loop.state().checkpoint;
    render(*scene, true, rest, [&](const Film& b, const RenderLoop&) {
      EXPECT_TRUE(same(a, b, Channel::denoised) && same(a, b, Channel::denoised_error));
    });
  });
}

}  // namespace
}  // namespace lumicut
