#include "bench/experiments/experiment_scene.h"

#include <array>
#include <cmath>

#include "core/parallel.h"
#include "integrators/integrator.h"
#include "vpl/trace_vpls.h"

namespace lumicut::bench {

namespace {

// Bits of a Morton code at the even places.
uint32_t even_bits(uint32_t x) {
  uint32_t out = 0;
  for (uint32_t b = 0; b < 16; ++b) out |= (x >> (2 * b) & 1u) << b;
  return out;
}

Light panel(const Vec3f& corner, const Vec3f& u, const Vec3f& v, float radiance) {
  Light l;
  l.type = LightType::rectangle;
  l.position = corner + (u + v) * 0.5f;
  l.u = u, l.v = v;
  l.value = Rgb{1, 0.9f, 0.8f} * radiance;
  return l;
}

BenchMesh box(const Vec3f& lo, const Vec3f& hi) {
  BenchMesh mesh;
  for (int i = 0; i < 8; ++i) mesh.positions.push_back({i & 1 ? hi.x : lo.x, i & 2 ? hi.y : lo.y, i & 4 ? hi.z : lo.z});
  for (const auto& q :
       {std::array<uint32_t, 4>{0, 1, 5, 4}, {2, 3, 7, 6}, {0, 2, 6, 4}, {1, 3, 7, 5}, {0, 1, 3, 2}, {4, 5, 7, 6}})
    for (const uint32_t k : {0, 1, 2, 0, 2, 3}) mesh.indices.push_back(q[k]);
  return mesh;
}

// The scene's mesh; in smoke runs a box about its views and lamps.
BenchMesh room_mesh(const std::string& name) {
  if (smoke()) return name == "conference" ? box({-900, 0, -700}, {1700, 600, 1100}) : box({-2, 0, -3}, {2, 3, 4.2f});
  const std::string folder = scenes_folder();
  return folder.empty() ? BenchMesh{} : load_obj(folder, name);
}

void add_mesh(Scene& scene, const BenchMesh& mesh, uint32_t material) {
  Mesh m;
  m.positions = mesh.positions, m.indices = mesh.indices, m.material = material;
  scene.add_mesh(std::move(m));
}

void finish(ExperimentScene& s) {
  const Params params(common_params());
  const float clamp = clamp_distance(params, *s.scene);
  s.clamp2 = clamp * clamp;
}

}  // namespace

void add_points(ExperimentScene& s, const View& view, uint32_t side) {
  s.side = side;
  Camera camera;
  camera.position = view.eye;
  camera.forward = normalize(view.at - view.eye);
  camera.right = normalize(cross(camera.forward, Vec3f{0, 1, 0}));
  camera.up = cross(camera.right, camera.forward);
  camera.tan_half_fov_y = std::tan(view.fov_y * 3.14159265f / 360.0f);
  uint32_t bits = 1;
  while ((1u << bits) < side) ++bits;
  for (uint32_t code = 0; code < 1u << (2 * bits); ++code) {
    const uint32_t x = even_bits(code), y = even_bits(code >> 1);
    if (x >= side || y >= side) continue;
    const auto fside = static_cast<float>(side);
    const auto c = camera.generate(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f, fside, fside, 0, 0);
    RayHit hit;
    hit.ray.org = c.origin, hit.ray.dir = c.direction;
    s.scene->accel().intersect({&hit, 1});
    if (hit.hit.geom == kNoId) continue;
    const SurfaceInteraction surface = s.scene->interaction(hit, y * side + x);
    s.points.push(surface.bsdf.layers()[0]);
    const float pixel = 2.0f * surface.t * c.forward_cosine * camera.tan_half_fov_y / fside;
    s.spread.push_back(std::sqrt(std::max(0.05f, std::abs(dot(surface.geometric_normal, c.direction)))) / pixel);
  }
  s.points.finish();
}

std::vector<Rgb> exhaustive(const ExperimentScene& s, size_t first, size_t last) {
  VplSet set;
  set.lights.assign(s.lights.lights.begin() + static_cast<std::ptrdiff_t>(first),
                    s.lights.lights.begin() + static_cast<std::ptrdiff_t>(last));
  const auto* entry = find_integrator("exhaustive");
  const Params params(all_params(*entry));
  const auto integrator = entry->create();
  Progress progress;
  Stats stats;
  integrator->prepare(*s.scene, set, params, {progress, stats});
  std::vector<Rgb> radiance(s.points.size());
  integrator->shade(s.points, radiance, {}, {progress, stats});
  return radiance;
}

std::unique_ptr<ExperimentScene> make_room(const std::string& name, uint32_t side, uint32_t direct, uint32_t indirect) {
  const BenchMesh mesh = room_mesh(name);
  if (mesh.triangles() == 0) return nullptr;
  auto s = std::make_unique<ExperimentScene>();
  s->name = name;
  s->scene = std::make_unique<Scene>(Scene::Config{});
  s->scene->set_materials({Material{.diffuse = {0.6f, 0.6f, 0.6f}}});
  add_mesh(*s->scene, mesh, 0);
  View view;
  if (name == "conference") {
    view = {{1560, 330, 470}, {250, 150, -350}, 60};
    s->scene->set_lights({panel({-850, 560, -200}, {0, 0, 1200}, {30, 0, 0}, 30),
                          panel({1560, 560, -200}, {0, 0, 1200}, {30, 0, 0}, 30),
                          panel({350, 590, -175}, {400, 0, 0}, {0, 0, 200}, 10)});
  } else {
    view = {{1.211f, 1.80475f, 3.85239f}, {0.7729f, 1.76308f, 2.95443f}, 50};
    s->scene->set_lights({panel({-0.5f, 2.9f, 1.0f}, {1, 0, 0}, {0, 0, 1}, 6),
                          panel({0.5f, 2.6f, -1.5f}, {0.3f, 0, 0}, {0, 0, 0.3f}, 20)});
  }
  Progress progress;
  s->scene->commit(progress);
  VplSet all = trace_vpls(*s->scene, {.count = direct, .max_depth = 0}, progress);
  s->direct = all.lights.size();
  // Without a share for direct light one light still stands for all of it, the first.
  const VplSet rest = trace_vpls(*s->scene, {.count = indirect + 1, .direct_share = 0.0f}, progress);
  all.lights.insert(all.lights.end(), rest.lights.begin() + 1, rest.lights.end());
  s->lights = off_surfaces(all, *s->scene);
  add_points(*s, view, side);
  finish(*s);
  s->reference_indirect = exhaustive(*s, s->direct, s->lights.lights.size());
  s->reference = exhaustive(*s, 0, s->direct);
  for (size_t i = 0; i < s->reference.size(); ++i) s->reference[i] += s->reference_indirect[i];
  return s;
}

std::unique_ptr<ExperimentScene> make_lantern(const BenchMesh& mesh, uint32_t side, uint32_t lights) {
  auto s = std::make_unique<ExperimentScene>();
  s->name = mesh.name;
  s->scene = std::make_unique<Scene>(Scene::Config{});
  s->scene->set_materials(
      {Material{.diffuse = {0.6f, 0.6f, 0.6f}}, Material{.diffuse = {0.6f, 0.6f, 0.6f}, .emission = {5, 4, 3}}});
  add_mesh(*s->scene, box({-1, 0, -1}, {1, 2, 1}), 0);
  BenchMesh lamp = mesh;
  Aabb b;
  for (const Vec3f& p : mesh.positions) b.extend(p);
  const float scale = 0.8f / b.extent().y;
  for (Vec3f& p : lamp.positions) p = (p - Vec3f{b.center().x, b.lo.y, b.center().z}) * scale + Vec3f{0, 0.01f, 0};
  // Scans are wound either way; this one glows outwards.
  double volume = 0;
  for (size_t t = 0; t < lamp.triangles(); ++t) {
    const Vec3f &a = lamp.positions[lamp.indices[3 * t]], &c = lamp.positions[lamp.indices[3 * t + 1]],
                &d = lamp.positions[lamp.indices[3 * t + 2]];
    volume += static_cast<double>(dot(a, cross(c, d)));
  }
  for (size_t t = 0; volume < 0 && t < lamp.triangles(); ++t)
    std::swap(lamp.indices[3 * t + 1], lamp.indices[3 * t + 2]);
  add_mesh(*s->scene, lamp, 1);
  Progress progress;
  s->scene->commit(progress);
  s->lights = off_surfaces(trace_vpls(*s->scene, {.count = lights, .max_depth = 0}, progress), *s->scene);
  s->direct = s->lights.lights.size();
  add_points(*s, {{0.0f, 1.0f, 0.98f}, {0, 0.7f, 0}, 90}, side);
  finish(*s);
  s->reference = exhaustive(*s, 0, s->direct);
  return s;
}

double rmse(const std::vector<Rgb>& image, const std::vector<Rgb>& reference) {
  double sum = 0, mean = 0;
  for (size_t i = 0; i < image.size(); ++i)
    for (int k = 0; k < 3; ++k) {
      const double d = static_cast<double>(image[i][k]) - static_cast<double>(reference[i][k]);
      sum += d * d, mean += static_cast<double>(reference[i][k]);
    }
  const double n = 3.0 * static_cast<double>(image.size());
  return std::sqrt(sum / n) / (mean / n);
}

double mean_error(const std::vector<Rgb>& image, const std::vector<Rgb>& reference) {
  double mean = 0, sum = 0;
  const auto n = static_cast<double>(image.size());
  for (const Rgb& c : reference) mean += static_cast<double>(luminance(c)) / n;
  for (size_t i = 0; i < image.size(); ++i) {
    const double r = luminance(reference[i]), f = luminance(image[i]);
    sum += std::abs(f - r) / std::max(r, 1e-3 * mean);
  }
  return sum / n;
}

}  // namespace lumicut::bench
