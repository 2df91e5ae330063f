// Our BVH beside Embree: build, quality, rays. One run, one thread unless said, Markdown on standard output.
// Times are of the thread's processor clock; contenders take turns, and medians are shown.
#include <tbb/task_arena.h>
#include <time.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <functional>
#include <map>

#include "accel/agglomerate.h"
#include "accel/bvh.h"
#include "accel/embree_api.h"
#include "bench/bvh/meshes.h"
#include "bench/bvh/rays.h"
#include "clustering/light_policy.h"
#include "clustering/light_tree.h"
#include "core/rng.h"

using namespace lumicut;
using namespace lumicut::bench;

namespace {

double clock_seconds(clockid_t clock) {
  timespec t;
  clock_gettime(clock, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

// Seconds of processor time of the whole process, which uses one thread here.
template <typename Fn>
double timed(Fn&& fn) {
  const double start = clock_seconds(CLOCK_PROCESS_CPUTIME_ID);
  fn();
  return clock_seconds(CLOCK_PROCESS_CPUTIME_ID) - start;
}
template <typename Fn>
double timed_wall(Fn&& fn) {
  const double start = clock_seconds(CLOCK_MONOTONIC);
  fn();
  return clock_seconds(CLOCK_MONOTONIC) - start;
}

double median(std::vector<double> v) {
  std::sort(v.begin(), v.end());
  return v.empty() ? 0.0 : v[v.size() / 2];
}

struct Contender {
  std::string name;
  std::function<void()> run;
  std::vector<double> seconds;
};

// Medians; contenders take turns, so that what else the machine does falls on all alike.
void race(std::vector<Contender>& contenders, int rounds) {
  for (Contender& c : contenders) c.run();  // warm
  for (int round = 0; round < rounds; ++round)
    for (Contender& c : contenders) c.seconds.push_back(timed(c.run));
}

// ---- Embree, called as well as it can be ----

class EmbreeScene {
 public:
  EmbreeScene(const BenchMesh& mesh, RTCBuildQuality quality, bool robust, unsigned mask = 0xffffffffu,
              bool filter = false) {
    device_ = rtcNewDevice("start_threads=0,set_affinity=0");
    scene_ = rtcNewScene(device_);
    rtcSetSceneBuildQuality(scene_, quality);
    rtcSetSceneFlags(scene_, robust ? RTC_SCENE_FLAG_ROBUST : RTC_SCENE_FLAG_NONE);
    const RTCGeometry g = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
    void* positions =
        rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, mesh.positions.size());
    std::memcpy(positions, mesh.positions.data(), mesh.positions.size() * 12);
    void* indices = rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, mesh.triangles());
    std::memcpy(indices, mesh.indices.data(), mesh.indices.size() * 4);
    rtcSetGeometryMask(g, mask);
    if (filter) rtcSetGeometryOccludedFilterFunction(g, [](const RTCFilterFunctionNArguments*) {});
    rtcCommitGeometry(g);
    rtcAttachGeometry(scene_, g);
    rtcReleaseGeometry(g);
    rtcCommitScene(scene_);
  }
  ~EmbreeScene() {
    rtcReleaseScene(scene_);
    rtcReleaseDevice(device_);
  }
  EmbreeScene(const EmbreeScene&) = delete;
  EmbreeScene& operator=(const EmbreeScene&) = delete;
  RTCScene get() const { return scene_; }

 private:
  RTCDevice device_;
  RTCScene scene_;
};

// Embree's records as a program would hold them: ready, aligned; only tfar is set anew for each run.
struct EmbreeRays {
  explicit EmbreeRays(const std::vector<Ray>& rays) : given(rays.size()) {
    std::memcpy(given.data(), rays.data(), rays.size() * sizeof(Ray));
  }
  std::vector<RTCRay> given;
};

uint64_t sink = 0;

void embree_occluded(const EmbreeScene& scene, const EmbreeRays& rays) {
  embree::Context context(false);
  for (const RTCRay& given : rays.given) {
    RTCRay r = given;
    context.occluded(scene.get(), &r);
    sink += r.tfar < 0;
  }
}

void embree_closest(const EmbreeScene& scene, const std::vector<RayHit>& rays) {
  embree::Context context(false);
  for (const RayHit& given : rays) {
    RTCRayHit r;
    std::memcpy(&r, &given, sizeof(r));
    context.intersect(scene.get(), &r);
    sink += r.hit.primID;
  }
}

enum class Call { single, packet16, stream_nm, stream_1m };

void embree_points(const EmbreeScene& scene, const std::vector<PointBundle>& bundles, Call call) {
  constexpr size_t n = kPointsPerLight;
  embree::Context context(call != Call::single);
  for (const PointBundle& b : bundles) {
    if (call == Call::single || call == Call::stream_1m) {
      RTCRay rays[n];
      for (size_t i = 0; i < n; ++i)
        rays[i] = {
            b.light.x,      b.light.y,   b.light.z, 0, b.x[i] - b.light.x, b.y[i] - b.light.y, b.z[i] - b.light.z, 0,
            0x1.fffffep-1f, 0xffffffffu, 0,         0};
      if (call == Call::single)
        for (RTCRay& r : rays) context.occluded(scene.get(), &r);
      else
        context.occluded_stream_aos(scene.get(), rays, n);
      for (const RTCRay& r : rays) sink += r.tfar < 0;
      continue;
    }
    const size_t step = call == Call::packet16 ? 16 : n;
    for (size_t begin = 0; begin < n; begin += step) {
      struct alignas(64) {
        float f[9][n];
        uint32_t u[3][n];
      } soa;
      // Arrays of `step` entries, one after the other, from the front of the record.
      auto* f = reinterpret_cast<float*>(&soa);
      auto* u = reinterpret_cast<uint32_t*>(f + 9 * step);
      for (size_t i = 0; i < step; ++i) {
        f[i] = b.light.x, f[step + i] = b.light.y, f[2 * step + i] = b.light.z, f[3 * step + i] = 0;
        f[4 * step + i] = b.x[begin + i] - b.light.x, f[5 * step + i] = b.y[begin + i] - b.light.y,
                     f[6 * step + i] = b.z[begin + i] - b.light.z;
        f[7 * step + i] = 0, f[8 * step + i] = 0x1.fffffep-1f;
        u[i] = 0xffffffffu, u[step + i] = 0, u[2 * step + i] = 0;
      }
      if (call == Call::packet16) {
        alignas(64) static const int valid[16] = {-1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1};
        context.occluded16(valid, scene.get(), reinterpret_cast<RTCRay16*>(f));
      } else {
        context.occluded_stream(scene.get(), reinterpret_cast<RTCRayN*>(f), static_cast<unsigned>(step), 12 * step * 4);
      }
      for (size_t i = 0; i < step; ++i) sink += f[8 * step + i] < 0;
    }
  }
}

// ---- Ours ----

void our_occluded(const Accel& accel, const std::vector<Ray>& rays) {
  Ray batch[256];
  for (size_t begin = 0; begin < rays.size(); begin += 256) {
    const size_t n = std::min<size_t>(256, rays.size() - begin);
    std::copy_n(rays.begin() + static_cast<ptrdiff_t>(begin), n, batch);
    accel.occluded({batch, n});
    for (size_t i = 0; i < n; ++i) sink += batch[i].tfar < 0;
  }
}
void our_closest(const Accel& accel, const std::vector<RayHit>& rays) {
  RayHit batch[256];
  for (size_t begin = 0; begin < rays.size(); begin += 256) {
    const size_t n = std::min<size_t>(256, rays.size() - begin);
    std::copy_n(rays.begin() + static_cast<ptrdiff_t>(begin), n, batch);
    accel.intersect({batch, n});
    for (size_t i = 0; i < n; ++i) sink += batch[i].hit.prim;
  }
}
void our_points(const Accel& accel, const std::vector<PointBundle>& bundles) {
  uint8_t out[kPointsPerLight];
  for (const PointBundle& b : bundles) {
    accel.occluded_from_point({b.light, false}, b.x, b.y, b.z, kPointsPerLight, out);
    for (const uint8_t o : out) sink += o;
  }
}

MeshView view_of(const BenchMesh& mesh) {
  MeshView view;
  view.positions = mesh.positions.data(), view.position_count = mesh.positions.size();
  view.indices = mesh.indices.data(), view.triangle_count = mesh.triangles();
  return view;
}
std::unique_ptr<Bvh> our_bvh(const BenchMesh& mesh, const std::string& builder, bool robust) {
  AccelOptions options;
  options.robust = robust, options.builder = builder;
  return Bvh::from_geometry({{view_of(mesh)}, {}, nullptr}, options);
}

std::vector<Aabb> boxes_of(const BenchMesh& mesh) {
  std::vector<Aabb> boxes(mesh.triangles());
  for (size_t i = 0; i < mesh.indices.size(); ++i) boxes[i / 3].extend(mesh.positions[mesh.indices[i]]);
  return boxes;
}

double geometric_mean(const std::vector<double>& v) {
  double sum = 0;
  for (const double x : v) sum += std::log(x);
  return v.empty() ? 0 : std::exp(sum / static_cast<double>(v.size()));
}

std::string machine() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);)
    if (line.rfind("model name", 0) == 0) return line.substr(line.find(':') + 2);
  return "unknown";
}

const std::vector<std::string> kBuilders = {
    kDefaultBuilder,        "sweep",          "agglomerative", "agglomerative+reinsert", "agglomerative-parallel",
    "binned-agglomerative", "sweep+reinsert", "binned",        "binned-longest"};

void bench_build(const std::vector<BenchMesh>& meshes, const std::vector<std::string>& real,
                 const std::vector<std::string>& builders, int rounds) {
  std::printf(
      "\n## Trees: E(cost) and microseconds a triangle\n\nOne thread, processor time, median of %d. The tree alone; "
      "our own rooms add the collapse to eight-wide nodes ('whole'). "
      "Embree builds its whole scene; its E(cost) is not to be had.\n\n",
      rounds);
  std::printf("| mesh | triangles |");
  for (const std::string& b : builders) std::printf(" %s |", b.c_str());
  std::printf(" whole (default) | Embree LOW | MEDIUM | HIGH |\n|---|---|");
  for (size_t i = 0; i < builders.size() + 4; ++i) std::printf("---|");
  std::printf("\n");
  std::map<std::string, std::vector<double>> against_sweep, divisive, boxes_against_exact, tris_against_exact;
  std::map<std::string, std::string> parts;  // Fig. 6, by mesh
  TreeCost exact_cost;
  std::vector<double> against_binned, against_longest;
  tbb::task_arena one(1);
  for (const BenchMesh& mesh : meshes) {
    const std::vector<Aabb> boxes = boxes_of(mesh);
    std::printf("| %s | %zu |", mesh.name.c_str(), mesh.triangles());
    double sweep = 0, exact = 0, exact_us = 0;
    const bool is_real = std::find(real.begin(), real.end(), mesh.name) != real.end();
    for (const std::string& name : builders) {
      std::vector<double> seconds;
      Tree tree;
      const bool slow = name.find("+reinsert") != std::string::npos;
      for (int i = 0; i < (slow ? 1 : rounds); ++i)
        seconds.push_back(timed([&] { one.execute([&] { tree = build_tree(boxes, build_options_of(name)); }); }));
      const TreeCost all = cost_of(tree);
      const double cost = all.cost, us = median(seconds) / static_cast<double>(boxes.size()) * 1e6;
      if (name == "sweep") sweep = cost;
      if (name == "agglomerative") exact = cost, exact_us = us, exact_cost = all;
      if (name == "agglomerative" || name == "binned-longest") {
        char text[96];
        std::snprintf(text, sizeof text, " %.1f | %.2f | %.1f |", all.boxes, all.tris, all.cost);
        parts[mesh.name] += text;
      }
      if (name == "binned-longest" && is_real && exact > 0) {
        boxes_against_exact[mesh.name].push_back(exact_cost.boxes / all.boxes);
        tris_against_exact[mesh.name].push_back(exact_cost.tris / all.tris);
      }
      if (is_real) against_sweep[name].push_back(cost / sweep);
      if (name == "binned-longest" && is_real)
        divisive[mesh.name].push_back(cost / exact), against_longest.push_back(exact_us / us);
      if (name == "binned") against_binned.push_back(exact_us / us);
      std::printf(" %.2f, %.2f µs |", cost, us);
      std::fflush(stdout);
    }
    const auto per_triangle = [&](double s) { return s / static_cast<double>(boxes.size()) * 1e6; };
    std::printf(" %.2f µs |", per_triangle(timed([&] { one.execute([&] { our_bvh(mesh, "", true); }); })));
    for (const RTCBuildQuality q : {RTC_BUILD_QUALITY_LOW, RTC_BUILD_QUALITY_MEDIUM, RTC_BUILD_QUALITY_HIGH})
      std::printf(" %.2f µs |", per_triangle(timed([&] { one.execute([&] { EmbreeScene(mesh, q, false); }); })));
    std::printf("\n");
  }
  std::printf("\nE(cost) against full sweep, geometric mean over the real scenes:");
  for (const auto& [name, values] : against_sweep) std::printf(" %s %.4f;", name.c_str(), geometric_mean(values));
  std::printf("\n\nDivisive (binned-longest) / agglomerative, per real scene (paper: 1.14 to 1.31):");
  for (const auto& [name, values] : divisive) std::printf(" %s %.2f;", name.c_str(), values[0]);
  std::printf(
      "\n\nWhat a line is expected to meet [Fig. 6]:\n\n| mesh | agglomerative: boxes | tris | cost | divisive: boxes "
      "| "
      "tris | cost |\n|---|---|---|---|---|---|---|\n");
  for (const auto& [name, text] : parts) std::printf("| %s |%s\n", name.c_str(), text.c_str());
  std::printf("\nAgglomerative / divisive, boxes and tris (paper: .68 to .83, .94 to .99):");
  for (const auto& [name, values] : boxes_against_exact)
    std::printf(" %s %.2f, %.2f;", name.c_str(), values[0], tris_against_exact[name][0]);
  std::printf(
      "\n\nTime of the exact build against our binned builds, geometric means: %.2f of binned (3 axes), %.2f of "
      "binned-longest.\n",
      geometric_mean(against_binned), geometric_mean(against_longest));
}

void bench_parallel(const std::vector<BenchMesh>& meshes, int rounds) {
  std::printf(
      "\n## Two threads\n\nWall seconds, median of %d; builders and numbers of threads take turns.\n\n| mesh | exact, "
      "1 "
      "thread | agglomerative-parallel (same tree), 1 thread | 2 threads | exact / parallel on 2 | "
      "binned-agglomerative, 1 thread | 2 threads | speedup |\n|---|---|---|---|---|---|---|---|\n",
      rounds);
  for (const BenchMesh& mesh : meshes) {
    const std::vector<Aabb> boxes = boxes_of(mesh);
    struct Run {
      const char* builder;
      int threads;
      std::vector<double> seconds;
    };
    Run runs[] = {{"agglomerative", 1, {}},
                  {"agglomerative-parallel", 1, {}},
                  {"agglomerative-parallel", 2, {}},
                  {"binned-agglomerative", 1, {}},
                  {"binned-agglomerative", 2, {}}};
    for (int round = 0; round < rounds; ++round)
      for (Run& run : runs) {
        tbb::task_arena arena(run.threads);
        run.seconds.push_back(
            timed_wall([&] { arena.execute([&] { build_tree(boxes, build_options_of(run.builder)); }); }));
      }
    double s[5];
    for (int i = 0; i < 5; ++i) s[i] = median(runs[i].seconds);
    std::printf("| %s | %.3f | %.3f | %.3f | %.2fx | %.3f | %.3f | %.2fx |\n", mesh.name.c_str(), s[0], s[1], s[2],
                s[0] / s[2], s[3], s[4], s[3] / s[4]);
    std::fflush(stdout);
  }
}

struct Ratios {
  std::map<std::string, std::vector<double>> of;
};

void means(const Ratios& ratios, const std::vector<Contender>& contenders) {
  std::printf("| geometric mean |");
  for (const Contender& c : contenders) std::printf(" %.3fx |", geometric_mean(ratios.of.at(c.name)));
  std::printf("\n");
}

struct NoHole : HitFilter {
  bool passes(const CandidateHit&) const override { return false; }
};

// What one mesh needs for all ray tables.
struct Subject {
  const BenchMesh* mesh;
  std::unique_ptr<EmbreeScene> high, robust;
  std::unique_ptr<Bvh> fast, safe;
  RaySet rays;
};

void bench_rays(const std::vector<BenchMesh>& meshes, const std::string& builder, size_t rays, int rounds,
                uint64_t seed) {
  std::printf(
      "\n## Rays\n\nMillions of rays a second on one thread (and the ratio to the first column); about %zu rays of "
      "each kind, median of %d turns. "
      "Our tree: '%s'. Instruction set: %s.\n",
      rays, rounds, builder.empty() ? "default" : builder.c_str(), traversal_target());
  Ratios ratios[5];
  std::vector<Contender> contenders[5];
  const char* titles[5] = {"Incoherent shadow rays", "64 nearby points to one light",
                           "64 unrelated points to one light (the same call)", "Primary rays (closest hit)",
                           "Diffuse bounce (closest hit)"};
  // One mesh at a time for memory's sake; rows are kept and shown table by table.
  std::vector<std::string> rows[5];
  for (const BenchMesh& mesh : meshes) {
    Subject s;
    s.mesh = &mesh;
    s.high = std::make_unique<EmbreeScene>(mesh, RTC_BUILD_QUALITY_HIGH, false);
    s.robust = std::make_unique<EmbreeScene>(mesh, RTC_BUILD_QUALITY_HIGH, true);
    s.fast = our_bvh(mesh, builder, false);
    s.safe = our_bvh(mesh, builder, true);
    s.rays = make_rays(*s.safe, rays, seed);
    if (s.rays.shadow.empty()) continue;
    const EmbreeRays shadow(s.rays.shadow);
    const auto run = [&](int t, size_t count, std::vector<Contender> list) {
      race(list, rounds);
      std::string row = "| " + mesh.name + " |";
      const double first = median(list[0].seconds);
      char text[64];
      for (Contender& c : list) {
        const double seconds = median(c.seconds);
        std::snprintf(text, sizeof(text), " %.2f (%.2fx) |", static_cast<double>(count) / seconds * 1e-6,
                      first / seconds);
        row += text;
        ratios[t].of[c.name].push_back(first / seconds);
      }
      rows[t].push_back(row);
      contenders[t] = std::move(list);
    };
    run(0, shadow.given.size(),
        {{"Embree HIGH", [&] { embree_occluded(*s.high, shadow); }, {}},
         {"Embree ROBUST", [&] { embree_occluded(*s.robust, shadow); }, {}},
         {"ours, fast", [&] { our_occluded(*s.fast, s.rays.shadow); }, {}},
         {"ours, robust", [&] { our_occluded(*s.safe, s.rays.shadow); }, {}}});
    for (const int t : {1, 2}) {
      const auto& bundles = t == 1 ? s.rays.coherent : s.rays.scattered;
      std::vector<Contender> list{{"Embree HIGH, single", [&] { embree_points(*s.high, bundles, Call::single); }, {}},
                                  {"packets of 16", [&] { embree_points(*s.high, bundles, Call::packet16); }, {}}};
      if (embree::kHasStreams) {
        list.push_back({"stream NM", [&] { embree_points(*s.high, bundles, Call::stream_nm); }, {}});
        list.push_back({"stream 1M", [&] { embree_points(*s.high, bundles, Call::stream_1m); }, {}});
      }
      list.push_back({"ROBUST, single", [&] { embree_points(*s.robust, bundles, Call::single); }, {}});
      list.push_back({"ROBUST, packets of 16", [&] { embree_points(*s.robust, bundles, Call::packet16); }, {}});
      if (embree::kHasStreams)
        list.push_back({"ROBUST, stream NM", [&] { embree_points(*s.robust, bundles, Call::stream_nm); }, {}});
      list.push_back({"ours, fast", [&] { our_points(*s.fast, bundles); }, {}});
      list.push_back({"ours, robust", [&] { our_points(*s.safe, bundles); }, {}});
      run(t, bundles.size() * kPointsPerLight, std::move(list));
    }
    for (const int t : {3, 4}) {
      const auto& list = t == 3 ? s.rays.primary : s.rays.diffuse;
      run(t, list.size(),
          {{"Embree HIGH", [&] { embree_closest(*s.high, list); }, {}},
           {"Embree ROBUST", [&] { embree_closest(*s.robust, list); }, {}},
           {"ours, fast", [&] { our_closest(*s.fast, list); }, {}},
           {"ours, robust", [&] { our_closest(*s.safe, list); }, {}}});
    }
    std::fprintf(stderr, "%s done\n", mesh.name.c_str());
  }
  for (int t = 0; t < 5; ++t) {
    if (rows[t].empty()) continue;
    std::printf("\n### %s\n\n| mesh |", titles[t]);
    for (const Contender& c : contenders[t]) std::printf(" %s |", c.name.c_str());
    std::printf("\n|---|");
    for (size_t i = 0; i < contenders[t].size(); ++i) std::printf("---|");
    std::printf("\n");
    for (const std::string& row : rows[t]) std::printf("%s\n", row.c_str());
    means(ratios[t], contenders[t]);
  }
}

// What masks, cut-outs and instances cost where they are used: the same rays, with each switched on and changing no
// answer.
void bench_features(const std::vector<BenchMesh>& meshes, size_t rays, int rounds, uint64_t seed) {
  std::printf(
      "\n## What features cost\n\nRobust mode, speed against the plain scene. Masks: the mesh has one that is not all "
      "ones. Cut-outs: each hit asks a filter that never lets through. "
      "Instance: the mesh is seen through one instance that does not move it.\n\n| mesh, rays | plain, Mrays/s | masks "
      "| cut-outs | instance |\n|---|---|---|---|---|\n");
  for (const BenchMesh& mesh : meshes) {
    const NoHole filter;
    AccelGeometry plain{{view_of(mesh)}, {}, nullptr}, masks = plain, cutouts = plain, instance = plain;
    masks.meshes[0].mask = 0x7fffffffu;
    cutouts.meshes[0].has_cutout = true, cutouts.filter = &filter;
    instance.instances = {{0, {}}};
    std::unique_ptr<Bvh> accels[4];
    int k = 0;
    for (const AccelGeometry& g : {plain, masks, cutouts, instance}) accels[k++] = Bvh::from_geometry(g, {});
    const RaySet set = make_rays(*accels[0], rays, seed);
    for (const bool points : {false, true}) {
      std::vector<Contender> list;
      for (const auto& a : accels) {
        if (points)
          list.push_back({"", [&] { our_points(*a, set.coherent); }, {}});
        else
          list.push_back({"", [&] { our_occluded(*a, set.shadow); }, {}});
      }
      race(list, rounds);
      const double base = median(list[0].seconds);
      std::printf("| %s, %s | %.2f |", mesh.name.c_str(), points ? "64 points to a light" : "shadow",
                  static_cast<double>(set.shadow.size()) / base * 1e-6);
      for (int i = 1; i < 4; ++i) std::printf(" %.2fx |", base / median(list[static_cast<size_t>(i)].seconds));
      std::printf("\n");
    }
  }
}

// Fig. 9: time against N for random lights and for triangles of a soup, beside N and N².
void bench_scaling(size_t most, uint64_t seed) {
  std::printf(
      "\n## Scaling [Walter et al. 2008, Fig. 9]\n\nSeconds on one thread; lights on the walls of a box, triangles of "
      "a soup. O(N) and O(N²) are drawn through the first row. Exponent: of time between this row and the last.\n\n"
      "| N | lights, heap | lights, locally ordered | lights, divisive 6D, whole tree | agglomerative, whole tree | "
      "triangles, locally ordered | O(N) | O(N²) | exponent (lights, locally ordered) "
      "|\n|---|---|---|---|---|---|---|---|"
      "---|\n");
  double first = 0, last = 0, n0 = 0, last_n = 0;
  for (size_t n = 1000; n <= most; n = n * 10 > most && n < most ? most : n * 10) {
    Rng rng(seed, Stage::test);
    std::vector<LightLeaf> lights(n);
    for (LightLeaf& l : lights) {
      const uint32_t side = rng.next_below(6);
      const int axis = static_cast<int>(side / 2);
      l.kind = VplKind::oriented;
      l.position[axis] = static_cast<float>(side % 2);
      l.position[(axis + 1) % 3] = rng.next_float(), l.position[(axis + 2) % 3] = rng.next_float();
      l.normal[axis] = side % 2 == 0 ? 1.0f : -1.0f;
      if (l.position[(axis + 1) % 3] < 0.5f)  // half of them on rough walls
        l.normal = normalize(
            l.normal + (Vec3f{rng.next_float(), rng.next_float(), rng.next_float()} - Vec3f{0.5f, 0.5f, 0.5f}) * 0.8f);
      l.intensity = rng.next_float();
    }
    const std::vector<Aabb> boxes = boxes_of(soup(n, seed));
    const double heap = timed([&] { agglomerate_lights(lights, 1.7320508f, Strategy::heap); });
    const double local = timed([&] { agglomerate_lights(lights, 1.7320508f, Strategy::locally_ordered); });
    std::vector<Vpl> vpls(n);
    for (size_t i = 0; i < n; ++i) {
      vpls[i].position = lights[i].position, vpls[i].normal = lights[i].normal, vpls[i].kind = lights[i].kind;
      vpls[i].intensity = Rgb{1, 1, 1} * lights[i].intensity;
    }
    const auto whole = [&](LightTree::Method method) {
      tbb::task_arena one(1);
      Progress progress;
      return timed([&] {
        one.execute([&] { LightTree::build(vpls, {.method = method, .scene_diagonal = 1.7320508f}, progress); });
      });
    };
    const double divisive = whole(LightTree::Method::divisive_6d), tree = whole(LightTree::Method::agglomerative);
    const double triangles = timed([&] { agglomerate_boxes(boxes, Strategy::locally_ordered); });
    const auto dn = static_cast<double>(n);
    if (first == 0) first = local, n0 = dn;
    std::printf("| %zu | %.4f | %.4f | %.4f | %.4f | %.4f | %.4f | %.3g | %s |\n", n, heap, local, divisive, tree,
                triangles, first * dn / n0, first * (dn / n0) * (dn / n0),
                last > 0 ? std::to_string(std::log(local / last) / std::log(dn / last_n)).c_str() : "");
    std::fflush(stdout);
    last = local, last_n = dn;
  }
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Our BVH beside Embree");
  std::vector<std::string> names, sections{"build", "parallel", "rays", "features", "scaling"};
  std::string builder = kDefaultBuilder;
  std::vector<std::string> builders = kBuilders;
  size_t rays = 200000, most = 1000000;
  int rounds = 5;
  uint64_t seed = 1;
  app.add_option("--meshes", names, "scenes of LUMICUT_SCENES, or soup, scan, house");
  app.add_option("--sections", sections, "build, parallel, rays, features, scaling");
  app.add_option("--builders", builders, "of the section build; costs are against `sweep`, where it comes first");
  app.add_option("--builder", builder, "of the trees that rays are traced in");
  app.add_option("--rays", rays, "of each kind");
  app.add_option("--rounds", rounds, "turns of each contender");
  app.add_option("--most", most, "lights in the last row of the scaling table");
  app.add_option("--seed", seed, "of rays and generated meshes");
  CLI11_PARSE(app, argc, argv);
  const std::vector<std::string> real{"sibenik", "sponza", "sponza_dabrovic", "conference", "kitchen"};
  if (names.empty()) {
    names = real;
    names.insert(names.end(), {"soup", "scan", "house"});
  }
  std::printf("Command: `bench_bvh");
  for (int i = 1; i < argc; ++i) std::printf(" %s", argv[i]);
  std::printf("`. Machine: %s. Seed: %llu. Embree %d.%d.%d.\n", machine().c_str(),
              static_cast<unsigned long long>(seed), RTC_VERSION_MAJOR, RTC_VERSION_MINOR, RTC_VERSION_PATCH);
  const std::string folder = scenes_folder();
  std::vector<BenchMesh> meshes;
  for (const std::string& name : names) {
    BenchMesh mesh;
    if (name == "soup")
      mesh = soup(sized(200000, 1000), seed);
    else if (name == "scan")
      mesh = scan(sized(100000, 1000));
    else if (name == "house")
      mesh = house(sized(300000, 1000), seed);
    else if (!folder.empty())
      mesh = load_obj(folder, name);
    if (mesh.indices.empty())
      std::printf("\n(%s is left out: not found; LUMICUT_SCENES names the folder of scenes)\n", name.c_str());
    else
      meshes.push_back(std::move(mesh));
  }
  const auto wanted = [&](const char* s) { return std::find(sections.begin(), sections.end(), s) != sections.end(); };
  if (wanted("build")) bench_build(meshes, real, builders, std::min(rounds, 3));
  if (wanted("parallel")) bench_parallel(meshes, rounds);
  tbb::task_arena one(1);
  if (wanted("rays")) one.execute([&] { bench_rays(meshes, builder, rays, rounds, seed); });
  if (wanted("features")) one.execute([&] { bench_features(meshes, rays, rounds, seed); });
  if (wanted("scaling")) bench_scaling(most, seed);
  std::fprintf(stderr, "%llu\n", static_cast<unsigned long long>(sink));
  return 0;
}
