// Emitters with extent, one by one: their form, and places on them.
#include <numbers>
#include <tuple>

#include "lights/light_sampler.h"
#include "lights/light_vpls.h"

namespace lumicut {

Aabb EmitterShape::bounds() const {
  Aabb box;
  if (kind == Kind::sphere) {
    box.extend(corner - Vec3f{radius, radius, radius}), box.extend(corner + Vec3f{radius, radius, radius});
    return box;
  }
  box.extend(corner), box.extend(corner + u), box.extend(corner + v);
  if (kind != Kind::triangle) box.extend(corner + u + v);
  return box;
}

Vec2f EmitterShape::along_edges(const Vec3f& at) const {
  const float uu = dot(u, u), uv = dot(u, v), vv = dot(v, v), det = uu * vv - uv * uv;
  const Vec3f d = at - corner;
  const float du = dot(d, u), dv = dot(d, v);
  return {(vv * du - uv * dv) / det, (uu * dv - uv * du) / det};
}

std::optional<EmitterShape> LightSampler::shape(size_t i) const {
  const Emitter& e = sampler_[extended_ + i];
  EmitterShape s;
  if (e.kind == Kind::triangle) {
    const Mesh& mesh = scene_.meshes()[e.index];
    const Transform& to_world = scene_.instance(e.index, e.instance);
    const uint32_t* index = &mesh.indices[3 * size_t{e.triangle}];
    s.kind = EmitterShape::Kind::triangle;
    s.corner = to_world.point(mesh.positions[index[0]]);
    s.u = to_world.point(mesh.positions[index[1]]) - s.corner;
    s.v = to_world.point(mesh.positions[index[2]]) - s.corner;
    const Vec3f n = cross(s.u, s.v);
    s.area = 0.5f * length(n);
    // The front stays the front in a mirroring instance.
    const Vec3f local =
        cross(mesh.positions[index[1]] - mesh.positions[index[0]], mesh.positions[index[2]] - mesh.positions[index[0]]);
    s.normal = normalize(dot(to_world.normal(local), n) < 0.0f ? -n : n);
    s.both_sides = scene_.materials()[mesh.material_of(e.triangle)].emit_both_sides;
    return s;
  }
  if (e.kind == Kind::sun || e.kind == Kind::soft) return {};
  const Light& l = scene_.lights()[e.index];
  if (e.kind == Kind::sphere) {
    s.kind = EmitterShape::Kind::sphere, s.corner = l.position, s.radius = l.radius;
    s.area = 4.0f * std::numbers::pi_v<float> * l.radius * l.radius;
    return s;
  }
  const bool disk = e.kind == Kind::disk;
  s.kind = disk ? EmitterShape::Kind::disk : EmitterShape::Kind::rectangle;
  s.corner = l.position - (l.u + l.v) * 0.5f, s.u = l.u, s.v = l.v;
  const Vec3f n = cross(l.u, l.v);
  s.area = length(n) * (disk ? std::numbers::pi_v<float> / 4 : 1.0f), s.normal = normalize(n);
  return s;
}

std::optional<Vec3f> LightSampler::place_of(size_t emitter) const {
  const Emitter& e = sampler_[emitter];
  if (e.kind == Kind::sun || e.kind == Kind::environment) return {};
  if (e.kind == Kind::triangle) {
    const EmitterShape s = *shape(emitter - extended_);
    return s.corner + (s.u + s.v) / 3.0f;
  }
  return scene_.lights()[e.index].position;
}

double LightSampler::cell(size_t i, const EmitterShape& s, uint64_t count, const DiscreteDistribution* chances) const {
  const double lights = chances != nullptr ? static_cast<double>(count) * chances->pmf(i)
                                           : static_cast<double>(count) * power_.sum(extended_ + i, extended_ + i + 1) /
                                                 power_.sum(extended_, sampler_.size());
  return static_cast<double>(s.area) * (s.both_sides ? 2.0 : 1.0) / lights;
}

Vpl LightSampler::place_on(size_t i, const EmitterShape& s, const Vec3f& at, const Vec3f& from, float area,
                           float& offset) const {
  const Emitter& e = sampler_[extended_ + i];
  Vpl v;
  v.kind = VplKind::oriented, v.position = at, v.normal = s.normal;
  if (e.kind == Kind::triangle) {
    // Barycentric coordinates of the place, and the rest as of any hit.
    const Vec2f along = s.along_edges(at);
    RayHit hit;
    hit.hit.u = std::clamp(along.x, 0.0f, 1.0f);
    hit.hit.v = std::clamp(along.y, 0.0f, 1.0f - hit.hit.u);
    hit.hit.prim = e.triangle, hit.hit.geom = e.index, hit.hit.inst = scene_.hit_instance(e.index, e.instance);
    const SurfaceHit surface = scene_.surface(hit);
    if (s.both_sides && dot(from - at, v.normal) < 0.0f) v.normal = -v.normal;
    Rgb radiance = scene_.emitted_on_average(surface, v.normal);
    if (scene_.materials()[surface.material].cutout())
      radiance *= scene_.opacity(e.index, e.triangle, hit.hit.u, hit.hit.v, e.instance);
    v.intensity = radiance * area, v.group = scene_.meshes()[e.index].group;
    set_reach(v, scene_.meshes()[e.index]);
    offset = surface.offset;
    return v;
  }
  const Light& l = scene_.lights()[e.index];
  v.group = l.group, set_reach(v, l);
  offset = 0.0f;  // lights block nothing
  if (e.kind == Kind::sphere) {
    v.normal = normalize(at - l.position);
    v.intensity = l.value * (area / (std::numbers::pi_v<float> * l.radius * l.radius));
    return v;
  }
  v.intensity = scene_.light_value(l, at) * area;
  spread(l, v);
  return v;
}

std::optional<size_t> LightSampler::emitter_of_light(uint32_t light) const {
  // Lights come first, in the scene's order.
  const auto begin = sampler_.begin() + static_cast<std::ptrdiff_t>(extended_);
  const auto end =
      std::partition_point(begin, sampler_.end(), [](const Emitter& e) { return e.kind != Kind::triangle; });
  const auto at = std::lower_bound(begin, end, light, [](const Emitter& e, uint32_t l) { return e.index < l; });
  if (at == end || at->index != light) return {};
  return static_cast<size_t>(at - begin);
}

std::optional<size_t> LightSampler::emitter_of_triangle(uint32_t mesh, uint32_t triangle, uint32_t instance) const {
  const auto begin = sampler_.begin() + static_cast<std::ptrdiff_t>(extended_);
  const auto key = [](const Emitter& e) {
    return std::tuple(e.kind == Kind::triangle, e.index, e.triangle, e.instance);
  };
  const auto wanted = std::tuple(true, mesh, triangle, instance);
  // Lights are before all triangles, whatever their numbers.
  const auto at = std::partition_point(begin, sampler_.end(),
                                       [&](const Emitter& e) { return e.kind != Kind::triangle || key(e) < wanted; });
  if (at == sampler_.end() || key(*at) != wanted) return {};
  return static_cast<size_t>(at - begin);
}

}  // namespace lumicut
