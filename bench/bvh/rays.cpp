#include "bench/bvh/rays.h"

#include <cmath>

#include "core/rng.h"

namespace lumicut::bench {
namespace {

Vec3f random_direction(Rng& rng) {
  const float z = 2.0f * rng.next_float() - 1.0f, phi = 6.2831853f * rng.next_float(),
              s = std::sqrt(std::max(0.0f, 1.0f - z * z));
  return {s * std::cos(phi), s * std::sin(phi), z};
}

struct Surface {
  Vec3f p, n;  // off the surface, on the side that was seen
};

}  // namespace

RaySet make_rays(const Accel& accel, size_t n, uint64_t seed) {
  Rng rng(seed, Stage::test);
  const Aabb box = accel.info().bounds;
  const float diagonal = box.diagonal(), epsilon = 1e-4f * diagonal;
  RaySet out;
  // Walks of a few bounces from random starts inside: points that light reaches.
  std::vector<Surface> seen;
  const size_t wanted = std::max<size_t>(n, 4096);
  for (size_t tries = 0; seen.size() < wanted && tries < 20 * wanted; ++tries) {
    RayHit r;
    const Vec3f e = box.extent();
    r.ray.org = box.lo + Vec3f{e.x * rng.next_float(), e.y * rng.next_float(), e.z * rng.next_float()};
    r.ray.dir = random_direction(rng);
    for (int bounce = 0; bounce < 4; ++bounce) {
      accel.intersect({&r, 1});
      if (r.hit.geom == kNoId) break;
      Vec3f normal = normalize(r.hit.ng);
      if (dot(normal, r.ray.dir) > 0) normal = -normal;
      const Vec3f p = r.ray.org + r.ray.dir * r.ray.tfar + normal * epsilon;
      if (bounce > 0) seen.push_back({p, normal});
      r = RayHit{};
      r.ray.org = p;
      r.ray.dir = normalize(normal + random_direction(rng) * 0.999f);
    }
  }
  if (seen.empty()) return out;
  const auto any = [&]() -> const Surface& { return seen[rng.next_below(static_cast<uint32_t>(seen.size()))]; };
  // Diffuse.
  for (size_t i = 0; i < n; ++i) {
    const Surface& s = any();
    RayHit r;
    r.ray.org = s.p;
    r.ray.dir = normalize(s.n + random_direction(rng) * 0.999f);
    out.diffuse.push_back(r);
  }
  // Shadow: lights are surface points too, as VPLs are.
  for (size_t i = 0; i < n; ++i) {
    const Surface &s = any(), &light = any();
    Ray r;
    r.org = s.p;
    r.dir = light.p - s.p;
    r.tfar = 0x1.fffffep-1f;
    out.shadow.push_back(r);
  }
  // Primary: from a place that sees far, in 8x8 tiles of a square image.
  Surface eye = any();
  float best = -1.0f;
  for (int i = 0; i < 64; ++i) {
    const Surface& s = any();
    RayHit r;
    r.ray.org = s.p, r.ray.dir = s.n;
    accel.intersect({&r, 1});
    const float far = r.hit.geom == kNoId ? 0.0f : r.ray.tfar;
    if (far > best) best = far, eye = {s.p + s.n * (0.1f * far), s.n};
  }
  const auto tiles = static_cast<size_t>(std::sqrt(static_cast<double>(n) / 64.0));
  const Frame frame(eye.n);
  const auto side = static_cast<float>(8 * tiles);
  for (size_t tile = 0; tile < tiles * tiles; ++tile)
    for (size_t i = 0; i < 64; ++i) {
      const float x = (static_cast<float>(tile % tiles * 8 + i % 8) + 0.5f) / side * 2.0f - 1.0f;
      const float y = (static_cast<float>(tile / tiles * 8 + i / 8) + 0.5f) / side * 2.0f - 1.0f;
      RayHit r;
      r.ray.org = eye.p;
      r.ray.dir = normalize(frame.to_world({x, y, 1.2f}));
      out.primary.push_back(r);
    }
  // 64 neighbouring points as a tile of 8x8 pixels sees them from near a surface, and 64 unrelated ones.
  const size_t bundles = n / kPointsPerLight;
  for (size_t b = 0; b < bundles;) {
    const Surface from = any();
    const Frame local(from.n);
    const float cx = 1.2f * rng.next_float() - 0.6f, cy = 1.2f * rng.next_float() - 0.6f;
    PointBundle bundle;
    size_t count = 0;
    for (size_t i = 0; i < 64; ++i) {
      RayHit r;
      r.ray.org = from.p;
      r.ray.dir = normalize(
          local.to_world({cx + static_cast<float>(i % 8) * 0.01f, cy + static_cast<float>(i / 8) * 0.01f, 1.0f}));
      accel.intersect({&r, 1});
      if (r.hit.geom == kNoId) continue;
      Vec3f normal = normalize(r.hit.ng);
      if (dot(normal, r.ray.dir) > 0) normal = -normal;
      const Vec3f p = r.ray.org + r.ray.dir * r.ray.tfar + normal * epsilon;
      bundle.x[count] = p.x, bundle.y[count] = p.y, bundle.z[count] = p.z;
      ++count;
    }
    if (count < 64) {  // open to the sky: take neighbours of what was seen
      if (count == 0) {
        bundle.x[0] = from.p.x, bundle.y[0] = from.p.y, bundle.z[0] = from.p.z;
        count = 1;
      }
      for (size_t i = count; i < 64; ++i)
        bundle.x[i] = bundle.x[i - count], bundle.y[i] = bundle.y[i - count], bundle.z[i] = bundle.z[i - count];
    }
    // Each tile meets several lights.
    for (int l = 0; l < 4 && b < bundles; ++l, ++b) {
      bundle.light = any().p;
      out.coherent.push_back(bundle);
    }
  }
  for (size_t b = 0; b < bundles; ++b) {
    PointBundle bundle;
    bundle.light = any().p;
    for (size_t i = 0; i < kPointsPerLight; ++i) {
      const Surface& s = any();
      bundle.x[i] = s.p.x, bundle.y[i] = s.p.y, bundle.z[i] = s.p.z;
    }
    out.scattered.push_back(bundle);
  }
  return out;
}

}  // namespace lumicut::bench
