#include "vpl/emitters.h"

#include <numbers>

namespace lumicut {

namespace {

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
  v.cos_outer = l.cos_outer, v.blend_cosine = l.blend_cosine, v.spot_cosine = l.spot_cosine ? 1.0f : 0.0f;
  return v;
}

// ∫ profile dω by the midpoint rule over the cosine: smooth, 1024 cells are exact to 1e-6.
double profile_solid_angle(const Vpl& spot) {
  constexpr int kCells = 1024;
  const double lo = std::max(-1.0f, spot.cos_outer), width = 1.0 - lo;
  double sum = 0.0;
  for (int i = 0; i < kCells; ++i) sum += spot_profile(spot, static_cast<float>(lo + width * (i + 0.5) / kCells));
  return 2.0 * std::numbers::pi * width * sum / kCells;
}

}  // namespace

Rgb lamp_radiance(const Light& light, float cosine) {
  if (!narrowed(light)) return light.value;
  const Vpl profile = spread_profile(light);
  return light.value * profile.intensity * (spot_profile(profile, cosine) / cosine);
}

DiscreteDistribution::DiscreteDistribution(const std::vector<double>& weights) {
  cdf_.resize(weights.size() + 1, 0.0);
  for (size_t i = 0; i < weights.size(); ++i) cdf_[i + 1] = cdf_[i] + std::max(0.0, weights[i]);
  total_ = cdf_.back();
}

size_t DiscreteDistribution::sample(double u) const {
  // First entry whose cumulative sum passes u·total: entries of weight 0 are never first.
  const auto it = std::upper_bound(cdf_.begin() + 1, cdf_.end(), u * total_);
  size_t i = std::min<size_t>(it - cdf_.begin() - 1, size() - 1);
  while (i > 0 && cdf_[i + 1] == cdf_[i]) --i;  // u·total rounded up to the total
  return i;
}

void Emitters::add(const Emitter& e, double power, bool extended) {
  if (!(power > 0.0)) return;
  emitters_.push_back(e);
  weights_.push_back(power);
  if (extended) {
    extended_.push_back(e);
    extended_weights_.push_back(power);
  }
}

Emitters::Emitters(const Scene& scene) : scene_(scene) {
  const double world_area = std::numbers::pi * scene.radius() * scene.radius();
  for (uint32_t i = 0; i < scene.lights().size(); ++i) {
    const Light& l = scene.lights()[i];
    const double value = luminance(l.value);
    if (!(max_component(l.value) > 0.0f)) continue;
    Vpl v;
    v.group = l.group;
    v.intensity = l.value;
    switch (l.type) {
      case LightType::point:
        add({l.radius > 0 ? Kind::sphere : Kind::point, i, 0, 0}, 4 * std::numbers::pi * value, l.radius > 0);
        if (!(l.radius > 0)) {
          v.position = l.position;
          delta_.push_back(v);
        }
        break;
      case LightType::spot:
        // A spot's sphere blurs the edge of its shadows alone; it is taken as a point here.
        add({Kind::spot, i, 0, 0}, value * profile_solid_angle(spot_of(l)), false);
        delta_.push_back(spot_of(l));
        break;
      case LightType::rectangle:
      case LightType::disk: {
        const bool disk = l.type == LightType::disk;
        const double area = length(cross(l.u, l.v)) * (disk ? std::numbers::pi / 4 : 1.0);
        add({disk ? Kind::disk : Kind::rectangle, i, 0, 0}, std::numbers::pi * area * value, true);
        break;
      }
      case LightType::sun:
        add({Kind::sun, i, 0, 0}, world_area * value, l.radius > 0);
        if (!(l.radius > 0)) {
          v.kind = VplKind::directional, v.normal = l.direction;
          delta_.push_back(v);
        }
        break;
    }
  }

  if (!scene.environment().black()) {
    const Environment& env = scene.environment();
    double integral = 4 * std::numbers::pi * luminance(env.color);
    if (env.texture >= 0) {
      const Texture& t = scene.textures()[env.texture];
      std::vector<double> weights(size_t{t.width()} * t.height());
      for (uint32_t y = 0; y < t.height(); ++y) {
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
    environment_power_ = world_area * integral;
    add({Kind::environment, 0, 0, 0}, environment_power_, true);
  }

  texture_mean_.assign(scene.textures().size(), Rgb{-1, 0, 0});
  for (uint32_t m = 0; m < scene.meshes().size(); ++m) {
    const Mesh& mesh = scene.meshes()[m];
    for (uint32_t t = 0; t < mesh.triangle_count(); ++t) {
      const Material& material = scene.materials()[mesh.material_of(t)];
      if (!material.emissive()) continue;
      Rgb emission = material.emission;
      if (material.emission_texture >= 0) {
        Rgb& mean = texture_mean_[material.emission_texture];
        if (mean.x < 0.0f) mean = scene.textures()[material.emission_texture].average();
        emission = emission * mean;
      }
      for (uint32_t i = 0; i < scene.instance_count(m); ++i) {
        const Transform& to_world = scene.instance(m, i);
        const uint32_t* index = &mesh.indices[3 * size_t{t}];
        const Vec3f a = to_world.point(mesh.positions[index[0]]), b = to_world.point(mesh.positions[index[1]]),
                    c = to_world.point(mesh.positions[index[2]]);
        const double area = 0.5 * length(cross(b - a, c - a));
        add({Kind::triangle, m, i, t},
            std::numbers::pi * area * luminance(emission) * (material.emit_both_sides ? 2 : 1), true);
      }
    }
  }
  power_ = DiscreteDistribution(weights_);
  extended_power_ = DiscreteDistribution(extended_weights_);
}

Emitters::Surface Emitters::sample_surface(const Emitter& e, Rng& rng) const {
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
    return {surface.position, surface.geometric_normal, scene_.emitted(surface, surface.geometric_normal), area_pdf};
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

Vec3f Emitters::sample_environment(Rng& rng, Rgb& radiance, float& pdf) const {
  const Environment& env = scene_.environment();
  if (env.texture < 0) {
    radiance = env.color;
    pdf = 0.25f / kPi;
    return uniform_sphere(rng.next_float(), rng.next_float());
  }
  const Texture& t = scene_.textures()[env.texture];
  const size_t i = texels_.sample((static_cast<double>(rng.next_u32()) + 0.5) * 0x1p-32);
  const auto x = static_cast<float>(i % t.width()), y = static_cast<float>(i / t.width());
  const float u = (x + rng.next_float()) / static_cast<float>(t.width());
  const float v = 1.0f - (y + rng.next_float()) / static_cast<float>(t.height());
  const float phi = (0.5f - u) * 2.0f * kPi, theta = (v - 0.5f) * kPi;  // theta: elevation
  const Vec3f d{std::cos(theta) * std::cos(phi), std::cos(theta) * std::sin(phi), std::sin(theta)};
  const float* m = env.world_to_map;  // a rotation: its transpose leads back
  const Vec3f world = normalize(Vec3f{m[0] * d.x + m[3] * d.y + m[6] * d.z, m[1] * d.x + m[4] * d.y + m[7] * d.z,
                                      m[2] * d.x + m[5] * d.y + m[8] * d.z});
  pdf = static_cast<float>(texels_.pmf(i) * static_cast<double>(texels_.size())) /
        (2.0f * kPi * kPi * std::max(1e-6f, std::cos(theta)));
  radiance = scene_.environment_radiance(world);
  return world;
}

Vec3f Emitters::sample_sun(const Light& light, Rng& rng) const {
  if (!(light.radius > 0.0f)) return light.direction;
  return Frame(light.direction).to_world(uniform_cone(std::cos(light.radius), rng.next_float(), rng.next_float()));
}

DirectSample Emitters::sample_direct(double u, uint64_t count, Rng& rng) const {
  const size_t i = extended_power_.sample(u);
  const Emitter& e = extended_[i];
  const double share = extended_power_.pmf(i);
  const auto weight = static_cast<float>(1.0 / (share * static_cast<double>(count)));
  DirectSample s;
  Vpl& v = s.vpl;
  if (e.kind == Kind::sun) {
    const Light& l = scene_.lights()[e.index];
    v.kind = VplKind::directional, v.normal = sample_sun(l, rng), v.intensity = l.value * weight, v.group = l.group;
  } else if (e.kind == Kind::environment) {
    Rgb radiance;
    float pdf;
    v.kind = VplKind::directional;
    v.normal = -sample_environment(rng, radiance, pdf);
    v.intensity = radiance * (weight / pdf);
    v.group = scene_.environment().group;
    s.seen_by_rays = true, s.density = share * pdf;
  } else {
    float area_pdf;
    v = surface_light(e, weight, rng, area_pdf);
    s.seen_by_rays = e.kind != Kind::sphere, s.density = share * area_pdf;
  }
  return s;
}

Vpl Emitters::surface_light(const Emitter& e, float weight, Rng& rng, float& area_pdf) const {
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

Vpl Emitters::sample_lamp(uint32_t lamp, Rng& rng) const {
  const Light& l = scene_.lights()[lamp];
  if (l.type == LightType::spot) return spot_of(l);
  if (l.type == LightType::point && !(l.radius > 0.0f)) {
    Vpl v;
    v.position = l.position, v.intensity = l.value, v.group = l.group;
    return v;
  }
  const Kind kind =
      l.type == LightType::point ? Kind::sphere : (l.type == LightType::disk ? Kind::disk : Kind::rectangle);
  float area_pdf;
  return surface_light({kind, lamp, 0, 0}, 1.0f, rng, area_pdf);
}

double Emitters::mesh_density(const SurfaceHit& surface) const {
  const Material& material = scene_.materials()[surface.material];
  if (!material.emissive() || !has_extended()) return 0.0;
  Rgb emission = material.emission;
  if (material.emission_texture >= 0) emission = emission * texture_mean_[material.emission_texture];
  // The area of the triangle, and the side where both emit, cancel.
  return std::numbers::pi * luminance(emission) / extended_power_.total();
}

double Emitters::lamp_density(uint32_t lamp) const {
  return std::numbers::pi * luminance(scene_.lights()[lamp].value) / extended_power_.total();
}

double Emitters::environment_density(const Vec3f& towards) const {
  if (!(environment_power_ > 0.0)) return 0.0;
  const double share = environment_power_ / extended_power_.total();
  const Environment& env = scene_.environment();
  if (env.texture < 0) return share * 0.25 / std::numbers::pi;
  const Texture& t = scene_.textures()[env.texture];
  const Vec2f uv = scene_.environment_uv(towards);
  const auto texel = [](double at, uint32_t count) {
    return static_cast<uint32_t>(std::clamp(at * count, 0.0, static_cast<double>(count) - 1));
  };
  const uint32_t x = texel(uv.x - std::floor(uv.x), t.width()), y = texel(1.0 - uv.y, t.height());
  const double elevation = (uv.y - 0.5) * std::numbers::pi;
  return share * texels_.pmf(size_t{y} * t.width() + x) * static_cast<double>(texels_.size()) /
         (2.0 * std::numbers::pi * std::numbers::pi * std::max(1e-6, std::cos(elevation)));
}

EmittedRay Emitters::distant_ray(const Vec3f& travel, const Rgb& irradiance, Rng& rng) const {
  const float r = scene_.radius() * std::sqrt(rng.next_float()), phi = 2.0f * kPi * rng.next_float();
  const Frame f(travel);
  const Vec3f center = scene_.bounds().empty() ? Vec3f{} : scene_.bounds().center();
  const Vec3f origin =
      center - travel * (2.0f * scene_.radius()) + f.t * (r * std::cos(phi)) + f.b * (r * std::sin(phi));
  return {origin, travel, irradiance * (kPi * scene_.radius() * scene_.radius()), 0};
}

EmittedRay Emitters::sample_ray(Rng& rng) const {
  const size_t i = power_.sample((static_cast<double>(rng.next_u32()) + 0.5) * 0x1p-32);
  const Emitter& e = emitters_[i];
  const auto weight = static_cast<float>(1.0 / power_.pmf(i));
  EmittedRay ray;
  switch (e.kind) {
    case Kind::point: {
      const Light& l = scene_.lights()[e.index];
      ray = {l.position, uniform_sphere(rng.next_float(), rng.next_float()), l.value * (4.0f * kPi), l.group};
      break;
    }
    case Kind::spot: {
      const Light& l = scene_.lights()[e.index];
      const Vec3f local = uniform_cone(l.cos_outer, rng.next_float(), rng.next_float());
      const float profile = spot_profile(spot_of(l), local.z);
      ray = {l.position, Frame(l.direction).to_world(local), l.value * (profile * 2.0f * kPi * (1.0f - l.cos_outer)),
             l.group};
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
      const Vec3f towards = sample_environment(rng, radiance, pdf);
      ray = distant_ray(-towards, radiance / pdf, rng);
      ray.group = scene_.environment().group;
      break;
    }
    case Kind::sphere:
    case Kind::rectangle:
    case Kind::disk:
    case Kind::triangle: {
      const Surface s = sample_surface(e, rng);
      const Vec3f local = cosine_hemisphere(rng.next_float(), rng.next_float());
      float factor = kPi / s.area_pdf;
      if (e.kind != Kind::triangle && narrowed(scene_.lights()[e.index]) && local.z > 0.0f) {
        const Vpl profile = spread_profile(scene_.lights()[e.index]);
        factor *= profile.intensity.x * spot_profile(profile, local.z) / local.z;
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
