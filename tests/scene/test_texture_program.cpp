#include "scene/texture_program.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "core/error.h"
#include "core/progress.h"
#include "core/rng.h"
#include "scene/color_ops.h"
#include "scene/noise.h"
#include "scene/patterns.h"
#include "scene/scene.h"
#include "scene/voronoi.h"

namespace {

using namespace lumicut;

ProgramInstruction step(ProgramOp op, std::vector<int32_t> inputs = {}, uint32_t mode = 0, uint32_t data = 0,
                        uint32_t count = 0) {
  ProgramInstruction in;
  in.op = static_cast<uint32_t>(op), in.mode = mode, in.data = data, in.count = count;
  std::copy(inputs.begin(), inputs.end(), in.inputs);
  return in;
}

Rgb run(std::vector<ProgramInstruction> steps, std::vector<Vec3f> constants = {}, std::vector<float> table = {},
        const ProgramPoint& point = {}) {
  return TextureProgram(std::move(steps), std::move(constants), std::move(table)).evaluate(point, {});
}

// Of an operation of numbers.
float math(uint32_t mode, float a, float b = 0, float c = 0) {
  return run({step(ProgramOp::math, {-1, -2, -3}, mode)}, {{a, a, a}, {b, b, b}, {c, c, c}}).x;
}

std::string refusal(const std::function<void()>& fn) {
  try {
    fn();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

Vec4f random_place(Rng& rng, float range) {
  const auto x = [&] { return range * (2.0f * rng.next_float() - 1.0f); };
  return {x(), x(), x(), x()};
}

TEST(TextureProgram, ComputesWhatItsOperationsSay) {
  EXPECT_FLOAT_EQ(math(0, 2, 3), 5);
  EXPECT_FLOAT_EQ(math(3, 2, 0), 0);  // a division by 0 gives 0
  EXPECT_FLOAT_EQ(math(5, -2, 2), 4);
  EXPECT_FLOAT_EQ(math(5, -2, 0.5f), 0);                // a root of what is below 0
  EXPECT_FLOAT_EQ(math(16, 1, 1.2f, 0.3f), 1);          // compare
  EXPECT_FLOAT_EQ(math(17, 1, 1, 0.6f), 1 - 0.6f / 6);  // smooth minimum of equals
  EXPECT_FLOAT_EQ(math(24, -7, 3), -1);                 // modulo has the sign of the first
  EXPECT_FLOAT_EQ(math(26, 5.5f, 2, 0), 1.5f);          // wrap
  EXPECT_FLOAT_EQ(math(28, 5, 2), 1);                   // ping-pong
  EXPECT_FLOAT_EQ(math(40, std::acos(-1.0f)), 180);
  const Rgb crossed = run({step(ProgramOp::vector, {-1, -2, -1}, 5)}, {{1, 0, 0}, {0, 1, 0}});
  EXPECT_EQ(crossed, (Rgb{0, 0, 1}));
  const Rgb mapped =
      run({step(ProgramOp::mapping, {-1, -2, -3, -4})}, {{1, 0, 0}, {5, 0, 0}, {0, 0, std::acos(0.0f)}, {2, 2, 2}});
  EXPECT_NEAR(mapped.x, 5, 1e-6);
  EXPECT_NEAR(mapped.y, 2, 1e-6);
  // A point and its texture mapping are inverse.
  const Rgb back = run({step(ProgramOp::mapping, {-1, -2, -3, -4}), step(ProgramOp::mapping, {0, -2, -3, -4}, 1)},
                       {{0.3f, -0.7f, 2}, {5, 1, 0}, {0.4f, 1.2f, -2}, {2, 3, 0.5f}});
  EXPECT_NEAR(back.x, 0.3f, 1e-5);
  EXPECT_NEAR(back.y, -0.7f, 1e-5);
  EXPECT_NEAR(back.z, 2, 1e-5);
}

TEST(TextureProgram, TablesAreLinearBetweenTheirEntries) {
  const std::vector<float> table = {0, 0, 0, 1, 2, 4};
  EXPECT_EQ(run({step(ProgramOp::ramp, {-1}, 0, 0, 6)}, {{0.25f, 0, 0}}, table), (Rgb{0.25f, 0.5f, 1}));
  EXPECT_EQ(run({step(ProgramOp::ramp, {-1}, 1, 0, 6)}, {{0.25f, 0, 0}}, table), (Rgb{0, 0, 0}));
  EXPECT_EQ(run({step(ProgramOp::ramp, {-1}, 0, 0, 6)}, {{7, 0, 0}}, table), (Rgb{1, 2, 4}));
  // A curve goes on beyond its range where it shall.
  const std::vector<float> curve = {0, 2, 0, 0, 0, 1, 1, 1};
  EXPECT_FLOAT_EQ(run({step(ProgramOp::curves, {-1, -2}, 1, 0, 8)}, {{1, 0, 0}, {4, 4, 4}}, curve).x, 2);
  EXPECT_FLOAT_EQ(run({step(ProgramOp::curves, {-1, -2}, 0, 0, 8)}, {{1, 0, 0}, {4, 4, 4}}, curve).x, 1);
}

TEST(TextureProgram, RefusesWhatIsWrongByInstructionFieldAndValue) {
  const auto made = [](std::vector<ProgramInstruction> steps, std::vector<Vec3f> constants = {},
                       std::vector<float> table = {}) {
    return refusal([&] { TextureProgram(std::move(steps), std::move(constants), std::move(table)); });
  };
  EXPECT_EQ(made({}), "instructions: there is none");
  EXPECT_EQ(made({step(static_cast<ProgramOp>(99))}), "instruction[0].op: 99 is not known");
  EXPECT_EQ(made({step(ProgramOp::uv, {}, 3)}), "instruction[0] (uv).mode: 3 is not below 1");
  EXPECT_EQ(made({step(ProgramOp::uv), step(ProgramOp::grey, {1})}),
            "instruction[1] (grey).inputs[0]: 1 is no earlier instruction");
  EXPECT_EQ(made({step(ProgramOp::grey, {-1})}),
            "instruction[0] (grey).inputs[0]: -1 is out of range: there are 0 constants");
  EXPECT_EQ(made({step(ProgramOp::uv, {2})}), "instruction[0] (uv).inputs[0]: 2 is not 0; it takes 0");
  EXPECT_EQ(made({step(ProgramOp::uv, {}, 0, 4)}), "instruction[0] (uv).data: 4 is not 0");
  EXPECT_EQ(made({step(ProgramOp::ramp, {-1}, 0, 0, 3)}, {{}}),
            "instruction[0] (ramp).data: 0 with count 3 is beyond the table's 0");
  EXPECT_EQ(made({step(ProgramOp::ramp, {-1}, 0, 0, 2)}, {{}}, {1, 2}),
            "instruction[0] (ramp).count: 2 is no multiple of 3 above 0");
  EXPECT_EQ(made({step(ProgramOp::uv)}, {{NAN, 0, 0}}), "constants[0] is not finite");
  EXPECT_EQ(made(std::vector<ProgramInstruction>(1025, step(ProgramOp::uv))), "instructions: 1025 are more than 1024");
}

TEST(TextureProgram, GivesNoInfinitiesNorNan) {
  const Vec3f huge{3e38f, 3e38f, 3e38f};
  EXPECT_EQ(run({step(ProgramOp::vector, {-1, -1, -1}, 2)}, {huge}), (Rgb{}));
  // Whatever every operation is given.
  for (const Vec3f& x : {Vec3f{}, huge, -huge, Vec3f{1e-45f, -1e-45f, 1}})
    for (uint32_t op = 0; op < program_ops().size(); ++op) {
      const ProgramOpInfo& info = program_ops()[op];
      if (info.data == ProgramData::texture) continue;
      for (uint32_t mode = 0; mode < info.modes; ++mode) {
        const bool tabled = info.data == ProgramData::table;
        const uint32_t count = !tabled                                         ? 0
                               : op == static_cast<uint32_t>(ProgramOp::brick) ? 4
                               : op == static_cast<uint32_t>(ProgramOp::ramp)  ? 6
                                                                               : 8;
        const auto value =
            run({step(static_cast<ProgramOp>(op), std::vector<int32_t>(info.inputs, -1), mode, 0, count)}, {x},
                std::vector<float>(8, 1.0f));
        EXPECT_TRUE(is_finite(value)) << info.name << " " << mode;
      }
    }
}

TEST(Noise, IsNothingOnTheLatticeAndWithinOneBetween) {
  Rng rng(1, Stage::test);
  for (int n = 1; n <= 4; ++n) {
    EXPECT_EQ(signed_noise({3, -4, 5, 6}, n), 0.0f);
    float low = 0, high = 0;
    for (int i = 0; i < 20000; ++i) {
      const float v = signed_noise(random_place(rng, 100), n);
      low = std::min(low, v), high = std::max(high, v);
    }
    EXPECT_GT(low, -1.05f);
    EXPECT_LT(high, 1.05f);  // the factors that scale it are rounded
    EXPECT_LT(low, -0.6f);
    EXPECT_GT(high, 0.6f);
  }
}

TEST(Noise, IsSmoothAcrossTheLattice) {
  Rng rng(2, Stage::test);
  for (int i = 0; i < 1000; ++i) {
    Vec4f p = random_place(rng, 20);
    p.x = std::round(p.x);
    Vec4f q = p, r = p;
    q.x -= 1e-3f, r.x += 1e-3f;
    const float slope = (signed_noise(p, 3) - signed_noise(q, 3)) - (signed_noise(r, 3) - signed_noise(p, 3));
    EXPECT_NEAR(slope, 0, 1e-4);  // second differences of a step of 1e-3, of a function with bounded curvature
  }
}

TEST(Voronoi, FindsTheNearestOfAllPoints) {
  Rng rng(3, Stage::test);
  for (int n = 1; n <= 4; ++n)
    for (int i = 0; i < 200; ++i) {
      const Vec4f p = random_place(rng, 5);
      VoronoiOptions o;
      o.dimensions = n;
      // All points within three cells, by hand.
      std::vector<float> distances;
      const int reach[4] = {3, n > 1 ? 3 : 0, n > 2 ? 3 : 0, n > 3 ? 3 : 0};
      for (int d = -reach[3]; d <= reach[3]; ++d)
        for (int c = -reach[2]; c <= reach[2]; ++c)
          for (int b = -reach[1]; b <= reach[1]; ++b)
            for (int a = -reach[0]; a <= reach[0]; ++a) {
              const Vec4f cell{std::floor(p.x) + static_cast<float>(a), std::floor(p.y) + static_cast<float>(b),
                               std::floor(p.z) + static_cast<float>(c), std::floor(p.w) + static_cast<float>(d)};
              const Vec4f h = hash_place(cell, n);
              const float x = cell.x + h.x - p.x, y = n > 1 ? cell.y + h.y - p.y : 0,
                          z = n > 2 ? cell.z + h.z - p.z : 0, w = n > 3 ? cell.w + h.w - p.w : 0;
              distances.push_back(std::sqrt(x * x + y * y + z * z + w * w));
            }
      std::sort(distances.begin(), distances.end());
      // Its own search sees the neighbours alone: in four dimensions the nearest may lie beyond them.
      if (distances[0] < 0.9f) {
        EXPECT_NEAR(voronoi(p, o).distance, distances[0], 1e-5) << n;
      }
      o.feature = VoronoiFeature::second;
      if (distances[1] < 0.9f) {
        EXPECT_NEAR(voronoi(p, o).distance, distances[1], 1e-5) << n;
      }
    }
}

TEST(Voronoi, DistanceToTheEdgeIsWhereTwoPointsAreAsNear) {
  Rng rng(4, Stage::test);
  VoronoiOptions first, second, edge;
  first.dimensions = second.dimensions = edge.dimensions = 2;
  second.feature = VoronoiFeature::second, edge.feature = VoronoiFeature::edge;
  int checked = 0;
  for (int i = 0; i < 500; ++i) {
    const Vec4f p = random_place(rng, 5);
    const VoronoiCell a = voronoi(p, first), b = voronoi(p, second);
    const float across = std::hypot(b.position.x - a.position.x, b.position.y - a.position.y);
    const float to_second = (b.distance * b.distance - a.distance * a.distance) / (2 * across);
    const float found = voronoi(p, edge).distance;
    EXPECT_LE(found, to_second + 1e-5f);  // some other point's edge may be nearer
    checked += std::abs(found - to_second) < 1e-5f ? 1 : 0;
  }
  EXPECT_GT(checked, 300);  // mostly it is the second's
}

TEST(Patterns, CheckersAlternateAlongEachAxis) {
  Rng rng(5, Stage::test);
  for (int i = 0; i < 200; ++i) {
    const Vec4f r = random_place(rng, 9);
    const Vec3f p{std::floor(r.x) + 0.3f, std::floor(r.y) + 0.6f, std::floor(r.z) + 0.5f};
    for (const Vec3f& next : {Vec3f{1, 0, 0}, Vec3f{0, 1, 0}, Vec3f{0, 0, 1}})
      EXPECT_EQ(checker(p) + checker(p + next), 1.0f);
  }
}

TEST(ColorOps, HsvAndHslLeadBack) {
  Rng rng(6, Stage::test);
  for (int i = 0; i < 500; ++i) {
    const Rgb c{rng.next_float(), rng.next_float(), rng.next_float()};
    for (const Rgb& back : {of_hsv(hsv_of(c)), of_hsl(hsl_of(c))}) {
      EXPECT_NEAR(back.x, c.x, 1e-5);
      EXPECT_NEAR(back.y, c.y, 1e-5);
      EXPECT_NEAR(back.z, c.z, 1e-5);
    }
  }
}

// A triangle of the plane z = 0 in the world, of which programs ask.
struct OneTriangle {
  Scene scene{Scene::Config{}};
  explicit OneTriangle(TextureProgram program, std::vector<MeshAttribute> attributes = {}, bool normal = false) {
    std::vector<Texture> textures;
    textures.emplace_back(std::move(program));
    scene.set_textures(std::move(textures));
    Material m;
    (normal ? m.normal_texture : m.diffuse_texture) = 0, m.diffuse = {1, 1, 1};
    scene.set_materials({m});
    Mesh mesh;
    mesh.positions = {{0, 0, 0}, {4, 0, 0}, {0, 4, 0}}, mesh.indices = {0, 1, 2};
    mesh.attributes = std::move(attributes);
    scene.add_mesh(std::move(mesh));
    Progress progress;
    scene.commit(progress);
  }
  SurfaceInteraction at(float x, float y) const {
    RayHit r;
    r.ray.org = {x, y, 3}, r.ray.dir = {0, 0, -1};
    scene.accel().intersect({&r, 1});
    EXPECT_NE(r.hit.geom, kNoId);
    return scene.interaction(r);
  }
};

TEST(TextureProgram, ReadsPlacesAndAttributesOfItsMesh) {
  MeshAttribute a;
  a.id = 7, a.components = 1, a.values = {0, 0.4f, 0.8f};
  const OneTriangle s({{step(ProgramOp::attribute, {}, 0, 7)}, {}, {}}, {a});
  EXPECT_NEAR(s.at(1, 1).bsdf.albedo().x, 0.25f * 0.4f + 0.25f * 0.8f, 1e-6);
  const OneTriangle p({{step(ProgramOp::position), step(ProgramOp::vector, {0, -1, -1}, 2)}, {{0.1f, 0.2f, 1}}, {}});
  EXPECT_NEAR(p.at(1, 2).bsdf.albedo().x, 0.1f, 1e-6);
  EXPECT_NEAR(p.at(1, 2).bsdf.albedo().y, 0.4f, 1e-6);
}

TEST(TextureProgram, ABumpTiltsTheNormalByTheSlopeOfItsHeight) {
  // Height = x / 2.
  const OneTriangle s(
      {{step(ProgramOp::position), step(ProgramOp::separate, {0}), step(ProgramOp::math, {1, -1, -1}, 2),
        step(ProgramOp::normal), step(ProgramOp::bump, {2, -2, -2, 3, -3})},
       {{0.5f, 0, 0}, {1, 1, 1}, {0, 0, 0}},
       {}},
      {}, true);
  const Vec3f n = s.at(1, 1).bsdf.normal(), wanted = normalize(Vec3f{-0.5f, 0, 1});
  // The slope is a difference over some 1e-3, of numbers that hold 1e-7.
  EXPECT_NEAR(n.x, wanted.x, 1e-3);
  EXPECT_NEAR(n.y, 0, 1e-3);
  EXPECT_NEAR(n.z, wanted.z, 1e-3);
}

TEST(TextureProgram, ABumpShowsAStepOfItsHeightAsWideAsItIsTold) {
  const auto tilted = [](float width, float x) {
    const OneTriangle s({{step(ProgramOp::position), step(ProgramOp::checker, {0}), step(ProgramOp::normal),
                          step(ProgramOp::bump, {1, -1, -1, 2, -2})},
                         {{1, 1, 1}, {width, 0, 0}},
                         {}},
                        {}, true);
    return s.at(x, 0.5f).bsdf.normal().z < 0.999f;
  };
  // The ray comes from 3 units; the height changes at x = 1, and slopes are taken to one side.
  EXPECT_NE(tilted(0.1f, 0.8f), tilted(0.1f, 1.2f)) << "steps of 0.3 reach over it";
  EXPECT_FALSE(tilted(0.1f, 0.6f) || tilted(0.1f, 1.4f));
  EXPECT_FALSE(tilted(0.05f, 0.8f) || tilted(0.05f, 1.2f)) << "steps of 0.15 do not";
  EXPECT_NE(tilted(0, 0.999f), tilted(0, 1.001f)) << "nor does a two-thousandth, but 0.0015 wide";
}

TEST(TextureProgram, ReferencesAreCheckedWhenTheSceneIsCommitted) {
  EXPECT_EQ(refusal([] {
              OneTriangle({{step(ProgramOp::image, {-1, -1, -1}, 0, 3)}, {{}}, {}});
            }),
            "texture[0].program: instruction[0] (image).data: 3 is out of range: the scene has 1 textures");
  EXPECT_EQ(refusal([] {
              OneTriangle({{step(ProgramOp::image, {-1, -1, -1}, 0, 0)}, {{}}, {}});
            }),
            "texture[0].program: instruction[0] (image).data: 0 is a program, not an image");
}

}  // namespace
