// What the sampler draws from: its emitters, their power, and the densities that follow. It draws in light_sampling.cpp.
#include "lights/light_sampler.h"

#include <numbers>

#include "core/parallel.h"
#include "lights/light_vpls.h"
#include "lights/texture_integral.h"

namespace lumicut {

namespace {

// ∫ profile dω by the midpoint rule over the cosine: smooth, 1024 cells are exact to 1e-6.
double profile_solid_angle(const Vpl& spot) {
  constexpr int kCells = 1024;
  const double lo = std::max(-1.0f, spot.cos_outer()), width = 1.0 - lo;
  double sum = 0.0;
  for (int i = 0; i < kCells; ++i) sum += spot_falloff(spot, static_cast<float>(lo + width * (i + 0.5) / kCells));
  return 2.0 * std::numbers::pi * width * sum / kCells;
}

// Of its radius: how far a lamp is from the geometry that its paths are aimed at.
constexpr float kFar = 10.0f;

// A lamp's own half size, and the solid angle that its light goes into, had it the same intensity everywhere.
float half_size(const Light& l) { return std::max(l.radius, 0.5f * (length(l.u) + length(l.v))); }
double spread_solid_angle(const Light& l) {
  if (l.type == LightType::spot) return 2.0 * std::numbers::pi * (1.0 - static_cast<double>(l.cos_outer));
  return (l.type == LightType::point ? 4.0 : 1.0) * std::numbers::pi;
}

}  // namespace

void LightSampler::find_far_lamps(std::vector<double> weights) {
  Aabb box;
  for (const SceneExtent::Part& part : scene_.extent().parts()) {
    const Vec3f half{part.radius, part.radius, part.radius};
    box.extend(part.center - half), box.extend(part.center + half);
  }
  if (box.empty()) return;
  geometry_ = {box.center(), 0.5f * box.diagonal()};
  bool any = false;
  for (size_t i = 0; i < sampler_.size(); ++i) {
    Emitter& e = sampler_[i];
    if (e.kind == Kind::triangle || e.kind == Kind::environment || e.kind == Kind::sun) continue;
    const Light& l = scene_.lights()[e.index];
    const float distance = length(l.position - geometry_.center);
    e.far = distance - half_size(l) > kFar * geometry_.radius;
    if (!e.far) continue;
    any = true;
    const double across = static_cast<double>(geometry_.radius) / static_cast<double>(distance);
    weights[i] *= std::min(1.0, std::numbers::pi * across * across / spread_solid_angle(l));
  }
  if (any) path_power_ = DiscreteDistribution(weights);
}

Rgb light_radiance(const Light& light, const Rgb& value, float cosine) {
  if (!narrowed(light)) return value;
  const Vpl profile = spread_profile(light);
  return value * profile.intensity * (spot_falloff(profile, cosine) / cosine);
}

void LightSampler::add_lights(std::vector<double>& weights, const Progress* progress) {
  const double world_area = std::numbers::pi * scene_.extent().radius() * scene_.extent().radius();
  // Those that a VPL each stands for first, then the environment, then those with extent.
  for (const bool extended : {false, true}) {
    if (extended) {
      const double power = environment_power(progress);
      if (power > 0.0) sampler_.push_back({Kind::environment, 0, 0, 0, false}), weights.push_back(power);
      environment_share_ = power;  // until the others' power is known
      extended_ = sampler_.size();
    }
    bool added = false;
    const auto add = [&](Kind kind, uint32_t light, double power, bool extent) {
      added = power > 0.0 && extent == extended;
      if (!added) return;
      sampler_.push_back({kind, light, 0, 0, false});
      weights.push_back(power);
    };
    for (uint32_t i = 0; i < scene_.lights().size(); ++i) {
      check_now_and_then(progress, i);
      const Light& l = scene_.lights()[i];
      const double value = luminance(l.value);
      if (!(max_component(l.value) > 0.0f)) continue;
      Vpl v;
      v.group = l.group;
      v.intensity = l.value;
      set_reach(v, l);
      const auto stands = [&](const Vpl& vpl) {
        if (extended) return;
        delta_.push_back(vpl), delta_emitter_.push_back(added ? static_cast<uint32_t>(sampler_.size() - 1) : kNoId);
      };
      switch (l.type) {
        case LightType::point:
          if (const LightProfile* profile = l.profile != 0 ? scene_.profiles().find(l.profile) : nullptr) {
            // Measured from afar: its sphere blurs the edges of shadows alone.
            add(Kind::profile, i, value * profile->solid_angle(), false);
            stands(profiled(l, *profile));
            break;
          }
          add(l.radius > 0 ? l.facing ? Kind::soft : Kind::sphere : Kind::point, i, 4 * std::numbers::pi * value,
              l.radius > 0);
          if (!(l.radius > 0)) v.position = l.position, stands(v);
          break;
        case LightType::spot:
          add(l.radius > 0 ? Kind::soft : Kind::spot, i, value * profile_solid_angle(spot_of(l)), l.radius > 0);
          if (!(l.radius > 0)) stands(spot_of(l));
          break;
        case LightType::rectangle:
        case LightType::disk: {
          const bool disk = l.type == LightType::disk;
          const double area = length(cross(l.u, l.v)) * (disk ? std::numbers::pi / 4 : 1.0);
          add(disk ? Kind::disk : Kind::rectangle, i, std::numbers::pi * area * mean_value(l), true);
          break;
        }
        case LightType::sun:
          add(Kind::sun, i, world_area * value, l.radius > 0);
          if (!(l.radius > 0)) v.kind = VplKind::directional, v.normal = l.direction, stands(v);
          break;
      }
    }
  }
}

double LightSampler::environment_power(const Progress* progress) {
  const Environment& env = scene_.environment();
  if (env.black()) return 0.0;
  double integral = 4 * std::numbers::pi * luminance(env.color);
  if (env.texture >= 0) {
    const Texture& t = scene_.textures()[env.texture];
    std::vector<double> weights(size_t{t.width()} * t.height());
    for (uint32_t y = 0; y < t.height(); ++y) {
      check_now_and_then(progress, 0);
      const double sine = std::sin(std::numbers::pi * (y + 0.5) / t.height());
      for (uint32_t x = 0; x < t.width(); ++x) {
        // The largest of the texel and its neighbours: bilinear filtering spreads light to texels that are black.
        float top = 0.0f;
        for (int dy = -1; dy <= 1; ++dy)
          for (int dx = -1; dx <= 1; ++dx)
            top = std::max(top, luminance(t.texel(
                                    (x + t.width() + dx) % t.width(),
                                    std::clamp<int>(static_cast<int>(y) + dy, 0, static_cast<int>(t.height()) - 1))));
        weights[size_t{y} * t.width() + x] = top * sine;
      }
    }
    texels_ = DiscreteDistribution(weights);
    integral = luminance(env.color * t.average()) > 0.0f && !texels_.empty()
                   ? luminance(env.color) * texels_.total() * 2 * std::numbers::pi * std::numbers::pi / weights.size()
                   : 0.0;
  }
  return std::numbers::pi * scene_.extent().radius() * scene_.extent().radius() * integral;
}

void LightSampler::add_triangles(std::vector<double>& weights, const Progress* progress) {
  const auto& materials = scene_.materials();
  size_t count = 0;
  for (uint32_t m = 0; m < scene_.meshes().size(); ++m) {
    const Mesh& mesh = scene_.meshes()[m];
    if (mesh_light(mesh) == MeshLight::by_rays) continue;
    for (uint32_t t = 0; t < mesh.triangle_count(); ++t) {
      check_now_and_then(progress, t);
      if (materials[mesh.material_of(t)].emissive()) count += scene_.instance_count(m);
    }
  }
  if (count == 0) return;
  sampler_.reserve(sampler_.size() + count);
  weights.reserve(weights.size() + count);

  // Where a texture emits, each triangle has the mean of its own part. A mesh whose power is not textured has none.
  textured_.resize(scene_.meshes().size());
  for (uint32_t id = 0; id < materials.size(); ++id) {
    const Material& material = materials[id];
    if (!material.emissive() || material.emission_texture < 0) continue;
    if (scene_.textures()[material.emission_texture].program() != nullptr) {
      add_programmed(id, progress);
      continue;
    }
    std::unique_ptr<TextureIntegral> integral;
    for (uint32_t m = 0; m < scene_.meshes().size(); ++m) {
      const Mesh& mesh = scene_.meshes()[m];
      const bool used = mesh.triangle_materials.empty()
                            ? mesh.material == id
                            : std::find(mesh.triangle_materials.begin(), mesh.triangle_materials.end(), id) !=
                                  mesh.triangle_materials.end();
      if (!used) continue;
      if (!integral)
        integral = std::make_unique<TextureIntegral>(scene_.textures()[material.emission_texture], material.emission,
                                                     progress);
      textured_[m].resize(std::max(textured_[m].size(), mesh.triangle_count()));
      parallel_chunks(mesh.triangle_count(), 1024, [&](size_t begin, size_t end) {
        check_now_and_then(progress, 0);
        for (size_t t = begin; t < end; ++t) {
          if (mesh.material_of(static_cast<uint32_t>(t)) != id) continue;
          const uint32_t* v = &mesh.indices[3 * t];
          const auto mean =
              static_cast<float>(mesh.uvs.empty() ? integral->mean({}, {}, {})
                                                  : integral->mean(mesh.uvs[v[0]], mesh.uvs[v[1]], mesh.uvs[v[2]]));
          for (size_t k = t; k < textured_[m].size(); k += mesh.triangle_count()) textured_[m][k] = mean;
        }
      });
    }
  }

  for (uint32_t m = 0; m < scene_.meshes().size(); ++m) {
    const Mesh& mesh = scene_.meshes()[m];
    if (mesh_light(mesh) == MeshLight::by_rays) continue;
    for (uint32_t t = 0; t < mesh.triangle_count(); ++t) {
      check_now_and_then(progress, t);
      const Material& material = materials[mesh.material_of(t)];
      if (!material.emissive()) continue;
      for (uint32_t i = 0; i < scene_.instance_count(m); ++i) {
        if (i > 0) check_now_and_then(progress, i);
        const double emission = mean_emission(material, m, t, i);
        const Transform& to_world = scene_.instance(m, i);
        const uint32_t* index = &mesh.indices[3 * size_t{t}];
        const Vec3f a = to_world.point(mesh.positions[index[0]]), b = to_world.point(mesh.positions[index[1]]),
                    c = to_world.point(mesh.positions[index[2]]);
        const double area = 0.5 * length(cross(b - a, c - a));
        const double power = std::numbers::pi * area * emission * (material.emit_both_sides ? 2 : 1);
        if (!(power > 0.0)) continue;
        has_meshes_ = true;
        sampler_.push_back({Kind::triangle, m, i, t, false});
        weights.push_back(power);
      }
    }
  }
}

double LightSampler::mean_emission(const Material& material, uint32_t mesh, uint32_t triangle,
                                   uint32_t instance) const {
  if (material.emission_texture < 0) return luminance(material.emission);
  const std::vector<float>& means = textured_[mesh];
  const size_t triangles = scene_.meshes()[mesh].triangle_count();
  return means[means.size() > triangles ? triangles * instance + triangle : triangle];
}

// Means over points of each triangle: fewer where there are many triangles, more where they differ much. A triangle whose
// points are all dark may still be lit between them, so that none is left without a small chance.
void LightSampler::add_programmed(uint32_t id, const Progress* progress) {
  constexpr size_t kMostPoints = size_t{1} << 22, kFewest = 4, kFirst = 64, kLast = 1024;
  constexpr double kError = 0.05, kLeastShare = 0.02;
  const TextureProgram& program = *scene_.textures()[scene_.materials()[id].emission_texture].program();
  const bool sides_differ = scene_.materials()[id].emit_both_sides && program.varies_with_view();
  for (uint32_t m = 0; m < scene_.meshes().size(); ++m) {
    const Mesh& mesh = scene_.meshes()[m];
    const size_t triangles = mesh.triangle_count();
    size_t used = 0;
    for (uint32_t t = 0; t < triangles; ++t) used += mesh.material_of(t) == id ? 1 : 0;
    if (used == 0) continue;
    const size_t instances = program.varies_with_instance() ? scene_.instance_count(m) : 1;
    std::vector<float>& means = textured_[m];
    if (means.size() < triangles * instances) {  // what other materials have found is that of each instance
      const std::vector<float> before = means;
      means.resize(triangles * instances);
      for (size_t i = before.size(); i < means.size(); ++i) means[i] = before.empty() ? 0.0f : before[i % triangles];
    }
    const size_t copies = means.size() / triangles;  // of one that varies for others alone
    const size_t first = std::clamp(kMostPoints / (used * instances), kFewest, kFirst);
    const size_t last = std::clamp(kMostPoints / (used * instances), first, kLast);
    const auto mean_of = [&](uint32_t t, uint32_t i) {
      // The plastic number's sequence, folded into the triangle. [Roberts 2018]
      double sum = 0, square = 0;
      size_t n = 0;
      for (size_t goal = first;; goal = std::min(last, 2 * goal)) {
        for (; n < goal; ++n) {
          double u = 0.5 + 0.7548776662466927 * static_cast<double>(n + 1),
                 v = 0.5 + 0.5698402909980532 * static_cast<double>(n + 1);
          u -= std::floor(u), v -= std::floor(v);
          if (u + v > 1) u = 1 - u, v = 1 - v;
          const SurfaceHit place = scene_.place_on(m, t, static_cast<float>(u), static_cast<float>(v), i);
          double e = luminance(scene_.emitted_on_average(place, place.geometric_normal));
          if (sides_differ) e = 0.5 * (e + luminance(scene_.emitted_on_average(place, -place.geometric_normal)));
          sum += e, square += e * e;
        }
        const double mean = sum / static_cast<double>(n), variance = square / static_cast<double>(n) - mean * mean;
        if (goal >= last || (mean > 0 && variance <= kError * kError * mean * mean * static_cast<double>(n)))
          return mean;
      }
    };
    parallel_chunks(triangles * instances, 16, [&](size_t begin, size_t end) {
      check_now_and_then(progress, 0);
      for (size_t k = begin; k < end; ++k) {
        const auto t = static_cast<uint32_t>(k % triangles), i = static_cast<uint32_t>(k / triangles);
        if (mesh.material_of(t) == id) means[k] = static_cast<float>(mean_of(t, i));
      }
    });
    double whole = 0;
    for (size_t k = 0; k < triangles * instances; ++k)
      if (mesh.material_of(static_cast<uint32_t>(k % triangles)) == id) whole += means[k];
    const auto least = static_cast<float>(kLeastShare * whole / static_cast<double>(used * instances));
    for (size_t k = 0; k < triangles * copies; ++k)
      if (mesh.material_of(static_cast<uint32_t>(k % triangles)) == id)
        means[k] = std::max(means[k % (triangles * instances)], least);
  }
}

LightSampler::LightSampler(const Scene& scene, const Progress* progress) : scene_(scene) {
  std::vector<double> weights;
  add_lights(weights, progress);
  add_triangles(weights, progress);
  for (Emitter& e : std::span(sampler_).subspan(extended_)) e.found_by_rays = is_found_by_rays(e);
  power_ = DiscreteDistribution(weights);
  find_far_lamps(std::move(weights));
  const double with_extent = has_extended() ? power_.sum(extended_, sampler_.size()) : 0.0;
  if (environment_share_ > 0.0) environment_share_ /= environment_share_ + with_extent;
}

size_t LightSampler::bytes() const {
  return sampler_.capacity() * sizeof(Emitter) + power_.bytes() + path_power_.bytes() + texels_.bytes() +
         delta_.capacity() * sizeof(Vpl);
}

double LightSampler::area_density(double emission) const {
  // The area of the emitter, and the side where both emit, cancel.
  return (1.0 - environment_share_) * std::numbers::pi * emission / power_.sum(extended_, sampler_.size());
}

MeshLight mesh_light(const Mesh& mesh) {
  if ((mesh.mask & kDiffuseRay) == 0) return MeshLight::by_rays;
  if (mesh.receivers != 0 || mesh.blockers != 0) return MeshLight::by_samples;
  // Samples pass what casts no shadow, and rays stop at the first of such surfaces: the two would not be weighted alike.
  constexpr uint32_t kByRays = kGlossyRay | kShadowRay;
  return (mesh.mask & kByRays) == kByRays ? MeshLight::by_samples_and_rays : MeshLight::by_samples;
}

bool LightSampler::is_found_by_rays(const Emitter& e) const {
  if (e.kind == Kind::triangle) return mesh_light(scene_.meshes()[e.index]) == MeshLight::by_samples_and_rays;
  return e.kind != Kind::sphere && e.kind != Kind::soft && e.kind != Kind::sun &&
         !scene_.lights()[e.index].reach.limited();
}

double LightSampler::mesh_density(const SurfaceHit& surface) const {
  const Material& material = scene_.materials()[surface.material];
  if (!material.emissive() || !has_extended()) return 0.0;
  if (mesh_light(scene_.meshes()[surface.mesh]) == MeshLight::by_rays) return 0.0;
  return area_density(mean_emission(material, surface.mesh, surface.triangle, surface.instance));
}

double LightSampler::mean_value(const Light& light) const {
  return luminance(light.texture < 0 ? light.value : light.value * scene_.textures()[light.texture].average());
}

double LightSampler::light_density(uint32_t light) const { return area_density(mean_value(scene_.lights()[light])); }

double LightSampler::environment_density(const Vec3f& towards) const {
  if (!has_environment()) return 0.0;
  const Environment& env = scene_.environment();
  if (env.texture < 0) return environment_share_ * 0.25 / std::numbers::pi;
  const Texture& t = scene_.textures()[env.texture];
  const Vec2f uv = scene_.environment_uv(towards);
  const auto texel = [](double at, uint32_t count) {
    return static_cast<uint32_t>(std::clamp(at * count, 0.0, static_cast<double>(count) - 1));
  };
  const uint32_t x = texel(uv.x - std::floor(uv.x), t.width()), y = texel(1.0 - uv.y, t.height());
  const double elevation = (uv.y - 0.5) * std::numbers::pi;
  return environment_share_ * texels_.pmf(size_t{y} * t.width() + x) * static_cast<double>(texels_.size()) /
         (2.0 * std::numbers::pi * std::numbers::pi * std::max(1e-6, std::cos(elevation)));
}

}  // namespace lumicut
