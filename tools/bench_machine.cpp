#include "tools/bench_machine.h"

#include <sys/utsname.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fstream>
#include <thread>

#include "io/physical_memory.h"
#include "lumicut_git_version.h"
#include "tools/commands.h"
#include "tools/render_setup.h"

namespace lumicut::tools {

using nlohmann::ordered_json;

ordered_json describe_machine() {
  ordered_json machine;
  machine["processor"] = "unknown";
  std::ifstream cpu("/proc/cpuinfo");
  for (std::string line; std::getline(cpu, line);)
    if (line.rfind("model name", 0) == 0 && line.find(": ") != std::string::npos) {
      machine["processor"] = line.substr(line.find(": ") + 2);
      break;
    }
  machine["threads"] = std::thread::hardware_concurrency();
  machine["memory_bytes"] = io::physical_memory();
  utsname name{};
  uname(&name);
  machine["system"] = std::string(name.sysname) + " " + name.release;
  machine["compiler"] = "GCC-compatible " __VERSION__;
  double load = 0;
  if (getloadavg(&load, 1) == 1) machine["load"] = load;
  return machine;
}

std::string git_description() { return LUMICUT_GIT_VERSION; }

namespace {

// Even numbers in [0,1), the same in every run. [splitmix64]
class Random {
 public:
  double next() {
    uint64_t z = state_ += 0x9e3779b97f4a7c15u;
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
    z = (z ^ z >> 27) * 0x94d049bb133111ebu;
    return static_cast<double>((z ^ z >> 31) >> 11) * 0x1p-53;
  }

 private:
  uint64_t state_ = 1;
};

using Point = std::array<float, 3>;

struct Triangles {
  std::vector<float> positions;
  std::vector<uint32_t> indices;
  Point corner(size_t triangle, size_t k) const {
    const float* p = &positions[3 * size_t{indices[3 * triangle + k]}];
    return {p[0], p[1], p[2]};
  }
};

// All instances in world space.
Triangles flatten(const io::SceneData& scene) {
  Triangles all;
  for (const auto& mesh : scene.meshes) {
    const size_t instances = std::max<size_t>(mesh.transforms.size() / 12, 1);
    for (size_t i = 0; i < instances; ++i) {
      const auto first = static_cast<uint32_t>(all.positions.size() / 3);
      for (size_t v = 0; v + 2 < mesh.positions.size(); v += 3) {
        const float* p = &mesh.positions[v];
        for (size_t r = 0; r < 3; ++r) {
          const float* m = mesh.transforms.empty() ? nullptr : &mesh.transforms[12 * i + 4 * r];
          all.positions.push_back(m ? m[0] * p[0] + m[1] * p[1] + m[2] * p[2] + m[3] : p[r]);
        }
      }
      for (const uint32_t index : mesh.indices) all.indices.push_back(first + index);
    }
  }
  return all;
}

}  // namespace

ordered_json measure_yardstick(const io::Api& api, const std::string& scene, int threads) {
  constexpr size_t kRays = 1000000;
  const Triangles triangles = flatten(read_scene_file(scene));
  std::vector<double> area_below;
  double area = 0;
  for (size_t t = 0; t < triangles.indices.size() / 3; ++t) {
    const Point a = triangles.corner(t, 0), b = triangles.corner(t, 1), c = triangles.corner(t, 2);
    std::array<double, 3> u{}, v{};
    for (size_t k = 0; k < 3; ++k) u[k] = double{b[k]} - a[k], v[k] = double{c[k]} - a[k];
    area += std::hypot(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]);
    area_below.push_back(area);
  }
  Random random;
  const auto point = [&] {
    const auto found = std::upper_bound(area_below.begin(), area_below.end(), random.next() * area);
    const auto t = std::min(static_cast<size_t>(found - area_below.begin()), area_below.size() - 1);
    const double s = std::sqrt(random.next()), r = random.next();
    const Point a = triangles.corner(t, 0), b = triangles.corner(t, 1), c = triangles.corner(t, 2);
    Point p{};
    for (size_t k = 0; k < 3; ++k) p[k] = static_cast<float>(a[k] * (1 - s) + b[k] * s * (1 - r) + c[k] * s * r);
    return p;
  };
  std::vector<lumicut_ray> rays(kRays);
  for (lumicut_ray& ray : rays) {
    const Point from = point(), to = point();
    ray = {from[0],   from[1], from[2], 1e-4f, to[0] - from[0], to[1] - from[1], to[2] - from[2], 0,
           1 - 1e-4f, ~0u,     0,       0};
  }
  const api::Device device(api, threads);
  auto desc = api::make<lumicut_accel_desc>();
  desc.positions = triangles.positions.data(), desc.position_count = triangles.positions.size() / 3;
  desc.indices = triangles.indices.data(), desc.triangle_count = triangles.indices.size() / 3;
  // Earlier tables have Embree's figure; a library without it gives that of its own tree.
  const auto build = [&](const char* kind) {
    desc.kind = kind;
    return api::Accel(device, desc);
  };
  const auto [kind, built] = [&] {
    try {
      return std::pair("embree", build("embree"));
    } catch (const api::Exception& e) {
      if (e.code() != LUMICUT_UNSUPPORTED) throw;
      return std::pair("bvh", build("bvh"));
    }
  }();
  double best = 1e30;
  size_t blocked = 0;
  for (int i = 0; i < 5; ++i) {
    stop_if_interrupted();
    std::vector<lumicut_ray> work = rays;
    const auto start = std::chrono::steady_clock::now();
    built.occluded(work);
    best = std::min(best, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
    blocked = static_cast<size_t>(std::count_if(work.begin(), work.end(), [](const auto& r) { return r.tfar < 0; }));
  }
  return {{"call", "lumicut_accel_occluded"},
          {"accel", kind},
          {"rays", kRays},
          {"mray_per_second", static_cast<double>(kRays) / best / 1e6},
          {"occluded", static_cast<double>(blocked) / kRays}};
}

}  // namespace lumicut::tools
