// What the integrators stand on, in figures: the exhaustive sum beside Embree's own occlusion calls on the same rays,
// the light tree's build, and the yardstick that compares one machine with another.
//   bench_kernels [MESH [THREADS]]      MESH: a folder of LUMICUT_SCENES (default conference)
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>

#include "accel/embree_api.h"
#include "bench/bvh/meshes.h"
#include "clustering/light_kernel.h"
#include "clustering/light_tree.h"
#include "core/parallel.h"
#include "integrators/integrator.h"
#include "lights/light_sampler.h"
#include "lights/trace_vpls.h"

namespace lumicut::bench {
namespace {

double now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

// Median of three, after one run to warm up.
template <typename Fn>
double seconds(Fn fn) {
  fn();
  double t[3];
  for (double& s : t) {
    const double start = now();
    fn();
    s = now() - start;
  }
  std::sort(t, t + 3);
  return t[1];
}

using embree::Context;

struct Embree {
  RTCDevice device = rtcNewDevice(nullptr);
  RTCScene scene = rtcNewScene(device);
  // The renderer's own scenes are robust; the yardstick's is not.
  Embree(const BenchMesh& mesh, bool robust) {
    if (robust) rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST), rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
    RTCGeometry g = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    auto* p = static_cast<Vec3f*>(
        rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, mesh.positions.size()));
    std::copy(mesh.positions.begin(), mesh.positions.end(), p);
    auto* i = static_cast<uint32_t*>(
        rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, mesh.triangles()));
    std::copy(mesh.indices.begin(), mesh.indices.end(), i);
    rtcCommitGeometry(g);
    rtcAttachGeometry(scene, g);
    rtcReleaseGeometry(g);
    rtcCommitScene(scene);
  }
  ~Embree() {
    rtcReleaseScene(scene);
    rtcReleaseDevice(device);
  }
  Embree(const Embree&) = delete;
  Embree& operator=(const Embree&) = delete;
};

RTCRay segment(const Vec3f& from, const Vec3f& to) {
  RTCRay r{};
  r.org_x = from.x, r.org_y = from.y, r.org_z = from.z;
  r.dir_x = to.x - from.x, r.dir_y = to.y - from.y, r.dir_z = to.z - from.z;
  r.tnear = 1e-4f, r.tfar = 1.0f - 1e-4f, r.mask = ~0u;
  return r;
}

// Embree 3.13.5 at MEDIUM quality and default flags traces `12.0` here on the machine of the published peer's figures.
void yardstick(const BenchMesh& mesh) {
  const Embree embree(mesh, false);
  std::vector<double> areas;
  for (size_t t = 0; t < mesh.triangles(); ++t) {
    const Vec3f a = mesh.positions[mesh.indices[3 * t]];
    areas.push_back(
        length(cross(mesh.positions[mesh.indices[3 * t + 1]] - a, mesh.positions[mesh.indices[3 * t + 2]] - a)));
  }
  const DiscreteDistribution by_area(areas);
  std::vector<RTCRay> rays;
  const auto count = sized<uint64_t>(1000000, 10000);
  for (uint64_t i = 0; i < count; ++i) {
    Rng rng(1, Stage::test, i);
    const auto point = [&] {
      const size_t t = by_area.sample((static_cast<double>(rng.next_u32()) + 0.5) * 0x1p-32);
      const Vec3f a = mesh.positions[mesh.indices[3 * t]], b = mesh.positions[mesh.indices[3 * t + 1]],
                  c = mesh.positions[mesh.indices[3 * t + 2]];
      const float s = std::sqrt(rng.next_float()), v = rng.next_float();
      return a * (1 - s) + b * (s * (1 - v)) + c * (s * v);
    };
    const Vec3f from = point(), to = point();
    rays.push_back(segment(from, to));
  }
  std::vector<RTCRay> work;
  std::atomic<uint64_t> blocked = 0;
  double best = 1e30;
  for (int run = 0; run < 5; ++run) {
    work = rays;
    blocked = 0;
    const double start = now();
    parallel_chunks(work.size(), 4096, [&](size_t begin, size_t end) {
      uint64_t hits = 0;
      Context context(false);
      for (size_t i = begin; i < end; ++i) {
        context.occluded(embree.scene, &work[i]);
        hits += work[i].tfar < 0;
      }
      blocked += hits;
    });
    best = std::min(best, now() - start);
  }
  std::printf("yardstick: rtcOccluded1 between random surface points: %.2f Mray/s, %.0f %% occluded\n",
              1e-6 * static_cast<double>(count) / best,
              100.0 * static_cast<double>(blocked) / static_cast<double>(count));
}

std::unique_ptr<Scene> make_scene(const BenchMesh& mesh) {
  auto scene = std::make_unique<Scene>(Scene::Config{});
  scene->set_materials({Material{}});
  Mesh m;
  m.positions = mesh.positions, m.indices = mesh.indices;
  scene->add_mesh(std::move(m));
  Progress progress;
  scene->commit(progress);
  // A light in the middle of the upper half.
  const Aabb b = scene->bounds();
  Light lamp;
  lamp.position = b.center() + Vec3f{0, 0.2f * b.extent().y, 0};
  lamp.value = Rgb{1, 1, 1} * scene->radius() * scene->radius();
  scene->set_lights({lamp});
  scene->commit(progress);
  return scene;
}

// Hits of a camera in a corner of the upper half, looking at the middle of the floor.
ShadePoints make_points(const Scene& scene, uint32_t side) {
  const Aabb b = scene.bounds();
  const Vec3f e = b.extent();
  Camera camera;
  camera.position = b.center() + Vec3f{0.35f * e.x, 0.05f * e.y, 0.3f * e.z};
  camera.forward = normalize(b.center() - Vec3f{0, 0.2f * e.y, 0} - camera.position);
  camera.right = normalize(cross(camera.forward, Vec3f{0, 1, 0}));
  camera.up = cross(camera.right, camera.forward);
  camera.tan_half_fov_y = 0.6f;
  ShadePoints points;
  for (uint32_t tile = 0; tile < (side / 4) * (side / 4); ++tile)  // 4x4 pixels a packet
    for (uint32_t i = 0; i < 16; ++i) {
      const uint32_t x = tile % (side / 4) * 4 + i % 4, y = tile / (side / 4) * 4 + i / 4;
      const auto s = camera.generate(x + 0.5f, y + 0.5f, side, side, 0, 0);
      RayHit hit;
      hit.ray.org = s.origin, hit.ray.dir = s.direction;
      scene.accel().intersect({&hit, 1});
      if (hit.hit.geom != kNoId) points.push(scene.interaction(hit, tile).bsdf.layers()[0]);
    }
  points.finish();
  return points;
}

void exhaustive(const BenchMesh& mesh) {
  const auto scene = make_scene(mesh);
  Progress progress;
  Stats stats;
  VplSet vpls = off_surfaces(trace_vpls(*scene, {.count = sized(1000u, 50u)}, progress), *scene);
  for (Vpl& v : vpls.lights) v.clamp2 = 0.0025f * scene->radius() * scene->radius();
  const ShadePoints points = make_points(*scene, sized(256u, 32u));
  Params params(all_params(*find_integrator("exhaustive")));
  const auto integrator = find_integrator("exhaustive")->create();
  integrator->prepare(*scene, vpls, params, {progress, stats});
  std::vector<Rgb> radiance(points.size());
  const auto whole = [&] { integrator->shade(points, radiance, {}, {progress, stats}); };
  const uint64_t before = stats.counters().rays;
  whole();
  const auto rays = static_cast<double>(stats.counters().rays - before);
  const double own = seconds(whole);

  // The same rays, in the same order, ready made: nothing but Embree's calls is timed.
  struct Packet {
    Vec3f light;
    uint32_t first, count;
  };
  std::vector<Vec3f> ends;
  std::vector<Packet> packets;
  auto lit = std::make_unique<LitPoints>();
  for (size_t first = 0; first < points.size(); first += kMaxLit)
    for (const Vpl& v : vpls.lights) {
      light_points(v, v.intensity, {}, points, first, std::min(kMaxLit, points.size() - first), *lit);
      packets.push_back({v.position, static_cast<uint32_t>(ends.size()), static_cast<uint32_t>(lit->count)});
      for (size_t i = 0; i < lit->count; ++i) ends.push_back({lit->x[i], lit->y[i], lit->z[i]});
    }
  const Embree embree(mesh, true);
  const auto each_packet = [&](auto fn) {
    tbb::parallel_for(tbb::blocked_range<size_t>(0, packets.size(), 64), [&](const auto& range) {
      for (size_t p = range.begin(); p < range.end(); ++p) fn(packets[p]);
    });
  };
  const double single = seconds([&] {
    each_packet([&](const Packet& p) {
      Context context(false);
      for (uint32_t i = 0; i < p.count; ++i) {
        RTCRay r = segment(p.light, ends[p.first + i]);
        context.occluded(embree.scene, &r);
      }
    });
  });
  const double packet16 = seconds([&] {
    each_packet([&](const Packet& p) {
      Context context(true);
      for (uint32_t i = 0; i < p.count; i += 16) {
        RTCRay16 r;
        alignas(64) int valid[16];
        for (uint32_t k = 0; k < 16; ++k) {
          valid[k] = i + k < p.count ? -1 : 0;
          const RTCRay s = segment(p.light, ends[p.first + std::min(i + k, p.count - 1)]);
          r.org_x[k] = s.org_x, r.org_y[k] = s.org_y, r.org_z[k] = s.org_z, r.tnear[k] = s.tnear;
          r.dir_x[k] = s.dir_x, r.dir_y[k] = s.dir_y, r.dir_z[k] = s.dir_z, r.tfar[k] = s.tfar;
          r.mask[k] = ~0u, r.time[k] = 0, r.id[k] = 0, r.flags[k] = 0;
        }
        context.occluded16(valid, embree.scene, &r);
      }
    });
  });
  const double stream = !embree::kHasStreams ? 1e30 : seconds([&] {
    each_packet([&](const Packet& p) {
      Context context(true);
      RTCRay r[kMaxLit];
      for (uint32_t i = 0; i < p.count; ++i) r[i] = segment(p.light, ends[p.first + i]);
      context.occluded_stream_aos(embree.scene, r, p.count);
    });
  });
  const double best = std::min({single, packet16, stream});
  std::printf("exhaustive, %zu points x %zu lights: %.1f M shadow rays\n", points.size(), vpls.lights.size(),
              rays / 1e6);
  std::printf("  Embree rtcOccluded1                %8.2f Mray/s\n", rays / single / 1e6);
  std::printf("  Embree rtcOccluded16, coherent     %8.2f Mray/s\n", rays / packet16 / 1e6);
  if (embree::kHasStreams) std::printf("  Embree rtcOccluded1M, coherent     %8.2f Mray/s\n", rays / stream / 1e6);
  std::printf("  exhaustive integrator, whole       %8.2f Mray/s = %.0f %% of Embree's best call alone\n",
              rays / own / 1e6, 100.0 * best / own);
}

void light_trees(const BenchMesh& mesh) {
  const auto scene = make_scene(mesh);
  Progress progress;
  for (const uint32_t count : {sized(60000u, 1000u), sized(1000000u, 5000u)}) {
    const VplSet vpls = trace_vpls(*scene, {.count = count}, progress);
    for (const auto& [name, method] : {std::pair{"agglomerative", LightTree::Method::agglomerative},
                                       {"divisive 3D", LightTree::Method::divisive_3d},
                                       {"divisive 6D", LightTree::Method::divisive_6d}}) {
      std::printf("light tree, %7zu lights, %-14s", vpls.lights.size(), name);
      for (int threads : {1, 2}) {
        Arena arena(threads);
        const double s = arena.run([&] {
          return seconds([&] { LightTree::build(vpls.lights, {method, 2 * scene->radius(), 1, 1}, progress); });
        });
        std::printf("  %d thread%s %7.3f s", threads, threads == 1 ? " " : "s", s);
      }
      std::printf("\n");
    }
  }
}

}  // namespace
}  // namespace lumicut::bench

int main(int argc, char** argv) {
  using namespace lumicut;
  using namespace lumicut::bench;
  const std::string name = argc > 1 ? argv[1] : "conference", folder = scenes_folder();
  BenchMesh mesh = folder.empty() || smoke() ? BenchMesh{} : load_obj(folder, name);
  if (mesh.triangles() == 0) {
    std::printf("no mesh %s in LUMICUT_SCENES: a generated house instead\n", name.c_str());
    mesh = house(sized(300000, 2000), 1);
  }
  Arena arena(argc > 2 ? std::atoi(argv[2]) : 0);
  std::printf("%s, %zu triangles, %d threads\n", mesh.name.c_str(), mesh.triangles(), arena.threads());
  arena.run([&] {
    yardstick(mesh);
    exhaustive(mesh);
  });
  light_trees(mesh);
}
