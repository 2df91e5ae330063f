#include "lights/light_sampler.h"

#include <numbers>

#include "core/parallel.h"
#include "lights/falloff.h"
#include "lights/texture_integral.h"

namespace lumicut {

namespace {

// y is drawn first: as arguments of one call, which the compiler may evaluate in either order, they gave another image
// with another compiler.
Vec2f random_pair(Rng& rng) {
  const float y = rng.next_float(), x = rng.next_float();
  return {x, y};
}

constexpr float kPi = std::numbers::pi_v<float>;

Vec3f uniform_sphere(float u, float v) {
  const float z = 1.0f - 2.0f * u, r = std::sqrt(std::max(0.0f, 1.0f - z * z)), phi = 2.0f * kPi * v;
  return {r * std::cos(phi), r * std::sin(phi), z};
}

// Local frame, z up.
Vec3f cosine_hemisphere(float u, float v) {
  const float r = std::sqrt(u), phi = 2.0f * kPi * v;
  return {r * std::cos(phi), r * std::sin(phi), std::sqrt(std::max(0.0f, 1.0f - u))};
}

// Uniform in the cone of cosines >= cos_min around z.
Vec3f uniform_cone(float cos_min, float u, float v) {
  const float z = 1.0f - u * (1.0f - cos_min), r = std::sqrt(std::max(0.0f, 1.0f - z * z)), phi = 2.0f * kPi * v;
  return {r * std::cos(phi), r * std::sin(phi), z};
}

Vpl oriented(const Vec3f& position, const Vec3f& normal, const Rgb& intensity, uint32_t group) {
  Vpl v;
  v.position = position, v.kind = VplKind::oriented, v.normal = normal, v.intensity = intensity, v.group = group;
  return v;
}

// Area lamps of spread s emit Lambert times N·max(0, 1 − tanθ·tan a), a = (π−s)/2, whose flux stays that of Lambert.
// [Cycles; docs/units.md]
Vpl spread_profile(const Light& light) {
  Vpl v;
  v.kind = VplKind::spot, v.spot_cosine = 1.0f;
  const float a = 0.5f * (kPi - light.spread);
  v.spread_tan = std::tan(a);
  v.intensity = Rgb{1, 1, 1} * (2.0f / (2.0f + (2.0f * a - kPi) * v.spread_tan));
  return v;
}
bool narrowed(const Light& light) {
  return (light.type == LightType::rectangle || light.type == LightType::disk) && light.spread < kPi - 1e-4f;
}

Vpl spot_of(const Light& l) {
  Vpl v;
  v.kind = VplKind::spot, v.position = l.position, v.normal = l.direction, v.intensity = l.value, v.group = l.group;
  v.cos_outer() = l.cos_outer, v.blend_cosine = l.blend_cosine, v.spot_cosine = l.spot_cosine ? 1.0f : 0.0f;
  return v;
}

// A point lamp with a measured profile.
Vpl profiled(const Light& l, const LightProfile& profile) {
  Vpl v;
  v.kind = VplKind::spot, v.position = l.position, v.normal = l.direction, v.intensity = l.value, v.group = l.group;
  v.profile = l.profile, v.cos_outer() = profile.cos_outer();
  v.blend_cosine = l.tangent.x, v.spot_cosine = l.tangent.y, v.spread_tan = l.tangent.z;
  return v;
}

// ∫ profile dω by the midpoint rule over the cosine: smooth, 1024 cells are exact to 1e-6.
double profile_solid_angle(const Vpl& spot) {
  constexpr int kCells = 1024;
  const double lo = std::max(-1.0f, spot.cos_outer()), width = 1.0 - lo;
  double sum = 0.0;
  for (int i = 0; i < kCells; ++i) sum += spot_falloff(spot, static_cast<float>(lo + width * (i + 0.5) / kCells));
  return 2.0 * std::numbers::pi * width * sum / kCells;
}

}  // namespace

Rgb lamp_radiance(const Light& light, float cosine) {
  if (!narrowed(light)) return light.value;
  const Vpl profile = spread_profile(light);
  return light.value * profile.intensity * (spot_falloff(profile, cosine) / cosine);
}

DiscreteDistribution::DiscreteDistribution(const std::vector<double>& weights) {
  cdf_.resize(weights.size() + 1, 0.0);
  for (size_t i = 0; i < weights.size(); ++i) cdf_[i + 1] = cdf_[i] + std::max(0.0, weights[i]);
  total_ = cdf_.back();
}

size_t DiscreteDistribution::sample(double u) const {
  double rest;
  return sample(u, 0, size(), rest);
}

size_t DiscreteDistribution::sample(double u, size_t first, size_t last, double& rest) const {
  // First entry whose cumulative sum passes u·sum: entries of weight 0 are never first.
  const double at = cdf_[first] + u * (cdf_[last] - cdf_[first]);
  const auto begin = cdf_.begin() + static_cast<std::ptrdiff_t>(first) + 1;
  const auto it = std::upper_bound(begin, cdf_.begin() + static_cast<std::ptrdiff_t>(last) + 1, at);
  size_t i = std::min<size_t>(static_cast<size_t>(it - cdf_.begin()) - 1, last - 1);
  while (i > first && cdf_[i + 1] == cdf_[i]) --i;  // rounded up to the sum
  rest = std::clamp((at - cdf_[i]) / (cdf_[i + 1] - cdf_[i]), 0.0, 1.0);
  return i;
}

void LightSampler::add_lamps(std::vector<double>& weights, const Progress* progress) {
  const double world_area = std::numbers::pi * scene_.radius() * scene_.radius();
  // Those that a VPL each stands for first, then the environment, then those with extent.
  for (const bool extended : {false, true}) {
    if (extended) {
      const double power = environment_power(progress);
      if (power > 0.0) sampler_.push_back({Kind::environment, 0, 0, 0}), weights.push_back(power);
      environment_share_ = power;  // until the others' power is known
      extended_ = sampler_.size();
    }
    const auto add = [&](Kind kind, uint32_t lamp, double power, bool extent) {
      if (!(power > 0.0) || extent != extended) return;
      sampler_.push_back({kind, lamp, 0, 0});
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
      const auto stands = [&](const Vpl& vpl) {
        if (!extended) delta_.push_back(vpl);
      };
      switch (l.type) {
        case LightType::point:
          if (const LightProfile* profile = l.profile != 0 ? scene_.profiles().find(l.profile) : nullptr) {
            // Measured from afar: its sphere blurs the edges of shadows alone.
            add(Kind::profile, i, value * profile->solid_angle(), false);
            stands(profiled(l, *profile));
            break;
          }
          add(l.radius > 0 ? Kind::sphere : Kind::point, i, 4 * std::numbers::pi * value, l.radius > 0);
          if (!(l.radius > 0)) v.position = l.position, stands(v);
          break;
        case LightType::spot:
          // A spot's sphere blurs the edge of its shadows alone; it is taken as a point here.
          add(Kind::spot, i, value * profile_solid_angle(spot_of(l)), false);
          stands(spot_of(l));
          break;
        case LightType::rectangle:
        case LightType::disk: {
          const bool disk = l.type == LightType::disk;
          const double area = length(cross(l.u, l.v)) * (disk ? std::numbers::pi / 4 : 1.0);
          add(disk ? Kind::disk : Kind::rectangle, i, std::numbers::pi * area * value, true);
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
  return std::numbers::pi * scene_.radius() * scene_.radius() * integral;
}

void LightSampler::add_triangles(std::vector<double>& weights, const Progress* progress) {
  const auto& materials = scene_.materials();
  size_t count = 0;
  for (uint32_t m = 0; m < scene_.meshes().size(); ++m) {
    const Mesh& mesh = scene_.meshes()[m];
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
      textured_[m].resize(mesh.triangle_count());
      parallel_chunks(mesh.triangle_count(), 1024, [&](size_t begin, size_t end) {
        check_now_and_then(progress, 0);
        for (size_t t = begin; t < end; ++t) {
          if (mesh.material_of(static_cast<uint32_t>(t)) != id) continue;
          const uint32_t* v = &mesh.indices[3 * t];
          textured_[m][t] =
              static_cast<float>(mesh.uvs.empty() ? integral->mean({}, {}, {})
                                                  : integral->mean(mesh.uvs[v[0]], mesh.uvs[v[1]], mesh.uvs[v[2]]));
        }
      });
    }
  }

  for (uint32_t m = 0; m < scene_.meshes().size(); ++m) {
    const Mesh& mesh = scene_.meshes()[m];
    for (uint32_t t = 0; t < mesh.triangle_count(); ++t) {
      check_now_and_then(progress, t);
      const Material& material = materials[mesh.material_of(t)];
      if (!material.emissive()) continue;
      const double emission = material.emission_texture >= 0 ? textured_[m][t] : luminance(material.emission);
      for (uint32_t i = 0; i < scene_.instance_count(m); ++i) {
        if (i > 0) check_now_and_then(progress, i);
        const Transform& to_world = scene_.instance(m, i);
        const uint32_t* index = &mesh.indices[3 * size_t{t}];
        const Vec3f a = to_world.point(mesh.positions[index[0]]), b = to_world.point(mesh.positions[index[1]]),
                    c = to_world.point(mesh.positions[index[2]]);
        const double area = 0.5 * length(cross(b - a, c - a));
        const double power = std::numbers::pi * area * emission * (material.emit_both_sides ? 2 : 1);
        if (!(power > 0.0)) continue;
        has_meshes_ = true;
        sampler_.push_back({Kind::triangle, m, i, t});
        weights.push_back(power);
      }
    }
  }
}

LightSampler::LightSampler(const Scene& scene, const Progress* progress) : scene_(scene) {
  std::vector<double> weights;
  add_lamps(weights, progress);
  add_triangles(weights, progress);
  power_ = DiscreteDistribution(weights);
  const double with_extent = has_extended() ? power_.sum(extended_, sampler_.size()) : 0.0;
  if (environment_share_ > 0.0) environment_share_ /= environment_share_ + with_extent;
}

size_t LightSampler::bytes() const {
  return sampler_.capacity() * sizeof(Emitter) + power_.bytes() + texels_.bytes() + delta_.capacity() * sizeof(Vpl);
}

LightSampler::Surface LightSampler::sample_surface(const Emitter& e, Rng& rng) const {
  const float u = rng.next_float(), v = rng.next_float();
  if (e.kind == Kind::triangle) {
    const Mesh& mesh = scene_.meshes()[e.index];
    const Material& material = scene_.materials()[mesh.material_of(e.triangle)];
    RayHit hit;  // a point of the triangle, made whole as any hit is
    const float s = std::sqrt(u);
    hit.hit.u = s * (1.0f - v), hit.hit.v = s * v;
    hit.hit.prim = e.triangle, hit.hit.geom = e.index;
    hit.hit.inst = scene_.hit_instance(e.index, e.instance);
    SurfaceHit surface = scene_.surface(hit);
    const Transform& to_world = scene_.instance(e.index, e.instance);
    const uint32_t* index = &mesh.indices[3 * size_t{e.triangle}];
    const Vec3f a = to_world.point(mesh.positions[index[0]]);
    const float area = 0.5f * length(cross(to_world.point(mesh.positions[index[1]]) - a,
                                           to_world.point(mesh.positions[index[2]]) - a));
    float area_pdf = 1.0f / area;
    if (material.emit_both_sides) {
      if (rng.next_float() < 0.5f) surface.geometric_normal = -surface.geometric_normal;
      area_pdf *= 0.5f;
    }
    Rgb radiance = scene_.emitted(surface, surface.geometric_normal);
    if (material.cutout()) radiance *= scene_.opacity(e.index, e.triangle, hit.hit.u, hit.hit.v);  // as rays meet it
    return {surface.position, surface.geometric_normal, radiance, area_pdf};
  }
  const Light& l = scene_.lights()[e.index];
  if (e.kind == Kind::sphere) {
    const Vec3f n = uniform_sphere(u, v);
    const float r2 = l.radius * l.radius;
    return {l.position + n * l.radius, n, l.value / (kPi * r2), 1.0f / (4.0f * kPi * r2)};
  }
  const Vec3f n = cross(l.u, l.v);
  const float parallelogram = length(n);
  if (e.kind == Kind::rectangle)
    return {l.position + l.u * (u - 0.5f) + l.v * (v - 0.5f), n / parallelogram, l.value, 1.0f / parallelogram};
  const float r = 0.5f * std::sqrt(u), phi = 2.0f * kPi * v;
  return {l.position + l.u * (r * std::cos(phi)) + l.v * (r * std::sin(phi)), n / parallelogram, l.value,
          4.0f / (kPi * parallelogram)};
}

Vec3f LightSampler::sample_environment(double u, double v, Rgb& radiance, float& pdf) const {
  const Environment& env = scene_.environment();
  if (env.texture < 0) {
    radiance = env.color;
    pdf = 0.25f / kPi;
    return uniform_sphere(static_cast<float>(u), static_cast<float>(v));
  }
  const Texture& t = scene_.textures()[env.texture];
  // The row by u, the texel within it by v, the place in the texel by what is left of both.
  double down, along;
  const size_t y = texels_.sample(u, 0, texels_.size(), down) / t.width();
  const size_t first = y * t.width(), last = first + t.width();
  down = std::clamp((texels_.sum(0, first) - u * texels_.total()) / -texels_.sum(first, last), 0.0, 1.0);
  const size_t i = texels_.sample(v, first, last, along);
  const double theta = (0.5 - (static_cast<double>(y) + down) / t.height()) * std::numbers::pi;  // elevation
  const double phi = (0.5 - (static_cast<double>(i - first) + along) / t.width()) * 2 * std::numbers::pi;
  const Vec3d local{std::cos(theta) * std::cos(phi), std::cos(theta) * std::sin(phi), std::sin(theta)};
  const Vec3f d{static_cast<float>(local.x), static_cast<float>(local.y), static_cast<float>(local.z)};
  const float* m = env.world_to_map;  // a rotation: its transpose leads back
  const Vec3f world = normalize(Vec3f{m[0] * d.x + m[3] * d.y + m[6] * d.z, m[1] * d.x + m[4] * d.y + m[7] * d.z,
                                      m[2] * d.x + m[5] * d.y + m[8] * d.z});
  pdf = static_cast<float>(texels_.pmf(i) * static_cast<double>(texels_.size()) /
                           (2 * std::numbers::pi * std::numbers::pi * std::max(1e-6, std::cos(theta))));
  radiance = scene_.environment_radiance(world);
  return world;
}

Vpl LightSampler::environment_light(uint64_t i, uint64_t count, uint64_t seed) const {
  Rng rng(seed, Stage::light_path, i, 2), all(seed, Stage::light_path, ~uint64_t{0}, 2);
  double inverse = 0.0, digit = 0.5;  // van der Corput, base 2
  for (uint64_t n = i; n != 0; n >>= 1, digit *= 0.5)
    if ((n & 1) != 0) inverse += digit;
  // Jittered within their strata, shifted as a whole.
  const double u = (static_cast<double>(i) + rng.next_float()) / static_cast<double>(count);
  double v = inverse + all.next_float() + rng.next_float() / static_cast<double>(count);
  v -= std::floor(v);
  Rgb radiance;
  float pdf;
  Vpl vpl;
  vpl.kind = VplKind::directional;
  vpl.normal = -sample_environment(u, v, radiance, pdf);
  vpl.intensity = radiance / (pdf * static_cast<float>(count));
  vpl.group = scene_.environment().group;
  return vpl;
}

Vec3f LightSampler::sample_sun(const Light& light, Rng& rng) const {
  if (!(light.radius > 0.0f)) return light.direction;
  const Vec2f at = random_pair(rng);
  return Frame(light.direction).to_world(uniform_cone(std::cos(light.radius), at.x, at.y));
}

Vpl LightSampler::sample_direct(double u, uint64_t count, Rng& rng) const {
  double rest;
  const size_t i = power_.sample(u, extended_, sampler_.size(), rest);
  const Emitter& e = sampler_[i];
  const auto weight =
      static_cast<float>(power_.sum(extended_, sampler_.size()) / (power_.sum(i, i + 1) * static_cast<double>(count)));
  float area_pdf;
  return extended_light(e, weight, rng, area_pdf);
}

Vpl LightSampler::extended_light(const Emitter& e, float weight, Rng& rng, float& area_pdf) const {
  if (e.kind == Kind::sun) {
    const Light& l = scene_.lights()[e.index];
    Vpl v;
    v.kind = VplKind::directional, v.normal = sample_sun(l, rng), v.intensity = l.value * weight, v.group = l.group;
    area_pdf = 0.0f;
    return v;
  }
  const Surface s = sample_surface(e, rng);
  area_pdf = s.area_pdf;
  const uint32_t group = e.kind == Kind::triangle ? scene_.meshes()[e.index].group : scene_.lights()[e.index].group;
  Vpl v = oriented(s.position, s.normal, s.radiance * (weight / s.area_pdf), group);
  if (e.kind != Kind::triangle && narrowed(scene_.lights()[e.index])) {
    const Vpl profile = spread_profile(scene_.lights()[e.index]);
    v.kind = VplKind::spot, v.spot_cosine = profile.spot_cosine, v.spread_tan = profile.spread_tan;
    v.intensity = v.intensity * profile.intensity;
  }
  return v;
}

DirectSample LightSampler::sample_light(Rng& rng) const {
  DirectSample s;
  const double choice = (static_cast<double>(rng.next_u32()) + 0.5) * 0x1p-32;
  if (choice < environment_share_) {
    const double u = (static_cast<double>(rng.next_u32()) + 0.5) * 0x1p-32, v = rng.next_float();
    Rgb radiance;
    float pdf;
    s.vpl.kind = VplKind::directional;
    s.vpl.normal = -sample_environment(u, v, radiance, pdf);
    s.density = environment_share_ * pdf;
    s.vpl.intensity = radiance / static_cast<float>(s.density);
    s.vpl.group = scene_.environment().group;
    s.seen_by_rays = true;
    return s;
  }
  double rest;
  const double u = (choice - environment_share_) / (1.0 - environment_share_);
  const size_t i = power_.sample(std::min(u, 1.0 - 0x1p-40), extended_, sampler_.size(), rest);
  const Emitter& e = sampler_[i];
  const double share = (1.0 - environment_share_) * power_.sum(i, i + 1) / power_.sum(extended_, sampler_.size());
  const auto weight = static_cast<float>(1.0 / share);
  float area_pdf;
  s.vpl = extended_light(e, weight, rng, area_pdf);
  s.on_mesh = e.kind == Kind::triangle;
  s.seen_by_rays = e.kind != Kind::sphere && e.kind != Kind::sun, s.density = share * area_pdf;
  return s;
}

Vpl LightSampler::sample_lamp(uint32_t lamp, Rng& rng) const {
  const Light& l = scene_.lights()[lamp];
  if (l.type == LightType::spot) return spot_of(l);
  if (l.type == LightType::point) {
    if (const LightProfile* profile = l.profile != 0 ? scene_.profiles().find(l.profile) : nullptr)
      return profiled(l, *profile);
    if (!(l.radius > 0.0f)) {
      Vpl v;
      v.position = l.position, v.intensity = l.value, v.group = l.group;
      return v;
    }
  }
  const Kind kind =
      l.type == LightType::point ? Kind::sphere : (l.type == LightType::disk ? Kind::disk : Kind::rectangle);
  float area_pdf;
  return extended_light({kind, lamp, 0, 0}, 1.0f, rng, area_pdf);
}

double LightSampler::area_density(double emission) const {
  // The area of the emitter, and the side where both emit, cancel.
  return (1.0 - environment_share_) * std::numbers::pi * emission / power_.sum(extended_, sampler_.size());
}

double LightSampler::mesh_density(const SurfaceHit& surface) const {
  const Material& material = scene_.materials()[surface.material];
  if (!material.emissive() || !has_extended()) return 0.0;
  return area_density(material.emission_texture >= 0 ? textured_[surface.mesh][surface.triangle]
                                                     : luminance(material.emission));
}

double LightSampler::lamp_density(uint32_t lamp) const { return area_density(luminance(scene_.lights()[lamp].value)); }

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

EmittedRay LightSampler::distant_ray(const Vec3f& travel, const Rgb& irradiance, Rng& rng) const {
  const float r = scene_.radius() * std::sqrt(rng.next_float()), phi = 2.0f * kPi * rng.next_float();
  const Frame f(travel);
  const Vec3f center = scene_.bounds().empty() ? Vec3f{} : scene_.bounds().center();
  const Vec3f origin =
      center - travel * (2.0f * scene_.radius()) + f.t * (r * std::cos(phi)) + f.b * (r * std::sin(phi));
  return {origin, travel, irradiance * (kPi * scene_.radius() * scene_.radius()), 0};
}

EmittedRay LightSampler::sample_ray(Rng& rng) const {
  const size_t i = power_.sample((static_cast<double>(rng.next_u32()) + 0.5) * 0x1p-32);
  const Emitter& e = sampler_[i];
  const auto weight = static_cast<float>(1.0 / power_.pmf(i));
  EmittedRay ray;
  switch (e.kind) {
    case Kind::point: {
      const Light& l = scene_.lights()[e.index];
      const Vec2f at = random_pair(rng);
      ray = {l.position, uniform_sphere(at.x, at.y), l.value * (4.0f * kPi), l.group};
      break;
    }
    case Kind::spot: {
      const Light& l = scene_.lights()[e.index];
      const Vec2f at = random_pair(rng);
      const Vec3f local = uniform_cone(l.cos_outer, at.x, at.y);
      const float profile = spot_falloff(spot_of(l), local.z);
      ray = {l.position, Frame(l.direction).to_world(local), l.value * (profile * 2.0f * kPi * (1.0f - l.cos_outer)),
             l.group};
      break;
    }
    case Kind::profile: {
      const Light& l = scene_.lights()[e.index];
      const LightProfile& profile = *scene_.profiles().find(l.profile);
      const double u = (static_cast<double>(rng.next_u32()) + 0.5) * 0x1p-32;
      const float v = rng.next_float();
      float vertical, horizontal, pdf;
      profile.sample(u, v, rng.next_float(), vertical, horizontal, pdf);
      const Vec3f bitangent = cross(l.tangent, l.direction);
      const Vec3f direction =
          normalize(l.direction * std::cos(vertical) +
                    (l.tangent * std::cos(horizontal) + bitangent * std::sin(horizontal)) * std::sin(vertical));
      ray = {l.position, direction, l.value * (profile(vertical, horizontal) / pdf), l.group};
      break;
    }
    case Kind::sun: {
      const Light& l = scene_.lights()[e.index];
      ray = distant_ray(sample_sun(l, rng), l.value, rng);
      ray.group = l.group;
      break;
    }
    case Kind::environment: {
      Rgb radiance;
      float pdf;
      const double u = (static_cast<double>(rng.next_u32()) + 0.5) * 0x1p-32, v = rng.next_float();
      const Vec3f towards = sample_environment(u, v, radiance, pdf);
      ray = distant_ray(-towards, radiance / pdf, rng);
      ray.group = scene_.environment().group;
      break;
    }
    case Kind::sphere:
    case Kind::rectangle:
    case Kind::disk:
    case Kind::triangle: {
      const Surface s = sample_surface(e, rng);
      const Vec2f at = random_pair(rng);
      const Vec3f local = cosine_hemisphere(at.x, at.y);
      float factor = kPi / s.area_pdf;
      if (e.kind != Kind::triangle && narrowed(scene_.lights()[e.index]) && local.z > 0.0f) {
        const Vpl profile = spread_profile(scene_.lights()[e.index]);
        factor *= profile.intensity.x * spot_falloff(profile, local.z) / local.z;
      }
      const uint32_t group = e.kind == Kind::triangle ? scene_.meshes()[e.index].group : scene_.lights()[e.index].group;
      ray = {offset(s), Frame(s.normal).to_world(local), s.radiance * factor, group};
      break;
    }
  }
  ray.flux = ray.flux * weight;
  return ray;
}

}  // namespace lumicut
