// Draws virtual lights and rays from the emitters that light_sampler.cpp has gathered.
#include <numbers>

#include "lights/light_sampler.h"
#include "lights/light_vpls.h"
#include "lights/soft_lamp.h"

namespace lumicut {

namespace {

// y is drawn first: as arguments of one call, which the compiler may evaluate in either order, they gave another image
// with another compiler.
Vec2f random_pair(Rng& rng) {
  const float y = rng.next_float(), x = rng.next_float();
  return {x, y};
}

Vec3f random_place(Rng& rng) {
  const float u = rng.next_float(), v = rng.next_float(), w = rng.next_float();
  return place_in_ball(u, v, w);
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

}  // namespace

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
    const SurfaceHit surface = scene_.surface(hit);
    Vec3f normal = surface.geometric_normal;
    const Transform& to_world = scene_.instance(e.index, e.instance);
    const uint32_t* index = &mesh.indices[3 * size_t{e.triangle}];
    const Vec3f a = to_world.point(mesh.positions[index[0]]);
    const float area = 0.5f * length(cross(to_world.point(mesh.positions[index[1]]) - a,
                                           to_world.point(mesh.positions[index[2]]) - a));
    float area_pdf = 1.0f / area;
    if (material.emit_both_sides) {
      if (rng.next_float() < 0.5f) normal = -normal;
      area_pdf *= 0.5f;
    }
    Rgb radiance = scene_.emitted_on_average(surface, normal);
    if (material.cutout())
      radiance *= scene_.opacity(e.index, e.triangle, hit.hit.u, hit.hit.v, e.instance);  // as rays meet it
    return {surface.position, normal, radiance, area_pdf, surface.offset};
  }
  const Light& l = scene_.lights()[e.index];
  const float offset = scene_.offset_at(l.position);
  if (e.kind == Kind::sphere) {
    const Vec3f n = uniform_sphere(u, v);
    const float r2 = l.radius * l.radius;
    return {l.position + n * l.radius, n, l.value / (kPi * r2), 1.0f / (4.0f * kPi * r2), offset};
  }
  const Vec3f n = cross(l.u, l.v);
  const float parallelogram = length(n);
  if (e.kind == Kind::rectangle) {
    const Vec3f at = l.position + l.u * (u - 0.5f) + l.v * (v - 0.5f);
    return {at, n / parallelogram, scene_.light_value(l, at), 1.0f / parallelogram, offset};
  }
  const float r = 0.5f * std::sqrt(u), phi = 2.0f * kPi * v;
  const Vec3f at = l.position + l.u * (r * std::cos(phi)) + l.v * (r * std::sin(phi));
  return {at, n / parallelogram, scene_.light_value(l, at), 4.0f / (kPi * parallelogram), offset};
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
  set_reach(vpl, scene_.environment());
  return vpl;
}

Vec3f LightSampler::sample_sun(const Light& light, Rng& rng) const {
  if (!(light.radius > 0.0f)) return light.direction;
  const Vec2f at = random_pair(rng);
  return Frame(light.direction).to_world(uniform_cone(std::cos(light.radius), at.x, at.y));
}

Vpl LightSampler::sample_direct(double u, uint64_t count, Rng& rng, const DiscreteDistribution* chances) const {
  double rest;
  const size_t i =
      chances != nullptr ? extended_ + chances->sample(u) : power_.sample(u, extended_, sampler_.size(), rest);
  const Emitter& e = sampler_[i];
  const auto weight =
      static_cast<float>(chances != nullptr ? 1.0 / (chances->pmf(i - extended_) * static_cast<double>(count))
                                            : power_.sum(extended_, sampler_.size()) /
                                                  (power_.sum(i, i + 1) * static_cast<double>(count)));
  ExtendedSample s = extended_light(e, weight, rng);
  s.vpl.offset = s.offset;
  if (s.area_pdf > 0.0f) s.vpl.cell = weight / s.area_pdf;
  return s.vpl;
}

DirectSample LightSampler::sample_extended(size_t i, Rng& rng) const {
  const ExtendedSample s = extended_light(sampler_[extended_ + i], 1.0f, rng);
  return {s.vpl, found_by_rays(i), s.offset, s.area_pdf};
}

// Light of a rectangle or disk whose spread is narrowed.
void LightSampler::spread(const Light& light, Vpl& v) {
  if (!narrowed(light)) return;
  const Vpl profile = spread_profile(light);
  v.kind = VplKind::spot, v.spot_cosine = profile.spot_cosine, v.spread_tan = profile.spread_tan;
  v.intensity = v.intensity * profile.intensity;
}

LightSampler::ExtendedSample LightSampler::extended_light(const Emitter& e, float weight, Rng& rng) const {
  if (e.kind == Kind::sun) {
    const Light& l = scene_.lights()[e.index];
    Vpl v;
    v.kind = VplKind::directional, v.normal = sample_sun(l, rng), v.intensity = l.value * weight, v.group = l.group;
    set_reach(v, l);
    return {v, 0.0f, 0.0f};
  }
  if (e.kind == Kind::soft) {
    Vpl v = soft_lamp(scene_.lights()[e.index], random_place(rng));
    v.intensity *= weight;
    return {v, 0.0f, 0.0f};
  }
  const Surface s = sample_surface(e, rng);
  const uint32_t group = e.kind == Kind::triangle ? scene_.meshes()[e.index].group : scene_.lights()[e.index].group;
  Vpl v = oriented(s.position, s.normal, s.radiance * (weight / s.area_pdf), group);
  if (e.kind == Kind::triangle)
    set_reach(v, scene_.meshes()[e.index]);
  else
    spread(scene_.lights()[e.index], v), set_reach(v, scene_.lights()[e.index]);
  return {v, s.area_pdf, s.offset};
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
    set_reach(s.vpl, scene_.environment());
    s.seen_by_rays = !scene_.environment().reach.limited();
    return s;
  }
  double rest;
  const double u = (choice - environment_share_) / (1.0 - environment_share_);
  const size_t i = power_.sample(std::min(u, 1.0 - 0x1p-40), extended_, sampler_.size(), rest);
  const Emitter& e = sampler_[i];
  const double share = (1.0 - environment_share_) * power_.sum(i, i + 1) / power_.sum(extended_, sampler_.size());
  const auto weight = static_cast<float>(1.0 / share);
  const ExtendedSample extended = extended_light(e, weight, rng);
  s.vpl = extended.vpl, s.offset = extended.offset;
  s.seen_by_rays = e.found_by_rays, s.density = share * extended.area_pdf;
  return s;
}

// Aimed at the sphere of one part of the scene, chosen by its share: a density of rays for each unit of area across
// them, whatever part they came from. Far grounds and domes get their share, and no more.
EmittedRay LightSampler::distant_ray(const Vec3f& travel, const Rgb& irradiance, Rng& rng) const {
  const auto parts = scene_.extent().parts();
  if (parts.empty()) return {};
  float choice = rng.next_float();
  size_t chosen = 0;
  while (chosen + 1 < parts.size() && choice >= parts[chosen].share) choice -= parts[chosen++].share;
  const float r = parts[chosen].radius * std::sqrt(rng.next_float()), phi = 2.0f * kPi * rng.next_float();
  const Frame f(travel);
  const Vec3f through = parts[chosen].center + f.t * (r * std::cos(phi)) + f.b * (r * std::sin(phi));
  double density = 0.0;
  float behind = 0.0f;
  for (const SceneExtent::Part& part : parts) {
    const Vec3f to_center = part.center - through;
    const float along = dot(to_center, travel), r2 = part.radius * part.radius;
    behind = std::max(behind, part.radius - along);
    // Its own part counts whatever rounding says.
    if (&part == &parts[chosen] || length2(to_center - travel * along) <= r2)
      density += static_cast<double>(part.share) / (std::numbers::pi * static_cast<double>(r2));
  }
  return {through - travel * behind, travel, irradiance * static_cast<float>(1.0 / density), 0};
}

// Through a place of the disk, across the way from the lamp, that stands before all geometry from there. It sets out near
// by: far coordinates are coarse.
EmittedRay LightSampler::aimed_ray(const Emitter& e, Rng& rng) const {
  const Light& l = scene_.lights()[e.index];
  Vpl v;
  v.position = l.position, v.intensity = l.value, v.group = l.group;
  if (e.kind == Kind::spot) v = spot_of(l);
  if (e.kind == Kind::profile) v = profiled(l, *scene_.profiles().find(l.profile));
  if (e.kind == Kind::soft || e.kind == Kind::sphere || e.kind == Kind::rectangle || e.kind == Kind::disk)
    v = extended_light(e, 1.0f, rng).vpl;
  const Vec3f way = geometry_.center - v.position;
  const float distance = length(way), sine = geometry_.radius / distance;
  const float radius = geometry_.radius / std::sqrt(1.0f - sine * sine);
  const float r = radius * std::sqrt(rng.next_float()), phi = 2.0f * kPi * rng.next_float();
  const Frame f(way / distance);
  const Vec3f across = f.t * (r * std::cos(phi)) + f.b * (r * std::sin(phi));
  const Vec3f direction = normalize(way + across);
  float share = 1.0f;
  if (v.kind == VplKind::oriented) share = std::max(0.0f, dot(v.normal, direction));
  if (v.kind == VplKind::spot) share = Falloff(scene_.profiles()).of_spot(v, direction);
  const float cosine = distance / std::sqrt(distance * distance + r * r);
  const float turn = radius * cosine / distance;  // the solid angle is π turn² cosine
  EmittedRay ray{geometry_.center + across - direction * (2.0f * radius), direction,
                 v.intensity * (share * kPi * turn * turn * cosine), l.group};
  if (l.facing) ray.disk_centre = l.position, ray.disk_radius = l.radius;
  return ray;
}

EmittedRay LightSampler::ray_from(const Emitter& e, Rng& rng) const {
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
    case Kind::soft: {
      const Light& l = scene_.lights()[e.index];
      const Vpl v = soft_lamp(l, random_place(rng));
      const Vec2f at = random_pair(rng);
      const Vec3f local = uniform_cone(v.cos_outer(), at.x, at.y);
      const Vec3f direction = Frame(l.direction).to_world(local);
      // From the disk that faces its way: a lamp at a ceiling shines from below it.
      ray = {v.position - direction * dot(direction, v.from_centre), direction,
             l.value * (spot_falloff(v, local.z) * 2.0f * kPi * (1.0f - v.cos_outer())), l.group};
      if (l.facing) ray.disk_centre = l.position, ray.disk_radius = l.radius;
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
  return ray;
}

EmittedRay LightSampler::sample_ray(Rng& rng, const DiscreteDistribution* chances) const {
  const DiscreteDistribution& choice = chances != nullptr ? *chances : path_power_.empty() ? power_ : path_power_;
  const size_t i = choice.sample((static_cast<double>(rng.next_u32()) + 0.5) * 0x1p-32);
  const Emitter& e = sampler_[i];
  const auto weight = static_cast<float>(1.0 / choice.pmf(i));
  EmittedRay ray = e.far ? aimed_ray(e, rng) : ray_from(e, rng);
  ray.flux = ray.flux * weight, ray.emitter = static_cast<uint32_t>(i);
  if (e.kind == Kind::triangle) {
    ray.reach.receivers = scene_.meshes()[e.index].receivers, ray.reach.blockers = scene_.meshes()[e.index].blockers;
  } else if (e.kind == Kind::environment) {
    ray.reach.seen_by = scene_.environment().reach.seen_by;
  } else {
    ray.shadows = scene_.lights()[e.index].shadows, ray.reach = scene_.lights()[e.index].reach;
  }
  return ray;
}

}  // namespace lumicut
