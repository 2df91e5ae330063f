#include "render/specular_chain.h"

namespace lumicut {

namespace {
constexpr uint32_t kMaxSurfaces = 64;  // chance ends chains long before
constexpr uint32_t kSureBounces = 4;
constexpr float kSureWeight = 0.25f;  // a smooth coat shows less, and would double the points to shade
// The ray that leaves by `s`.
ChainRay chain_ray(const Bsdf& bsdf, const BsdfSample& s, const Rgb& throughput, uint32_t pixel, Rng rng,
                   const ChainRay::State& state) {
  const bool straight = (s.flags & kStraight) != 0;
  return {
      bsdf.origin(s.flags),
      s.direction,
      throughput * s.weight,
      pixel,
      rng,
      {state.bounces + 1, state.passage, ray_kind(s.flags, state.kind),
       bsdf.absorption_after(s.flags, state.absorption), straight ? state.not_lit_by : bsdf.not_lit_by(), state.share},
      straight};
}
}  // namespace

std::optional<ChainRay> start_chain(const Bsdf& bsdf, const Rgb& throughput, uint32_t pixel, Rng rng,
                                    const ChainRay::State& state) {
  const float choice = rng.next_float(), u = rng.next_float(), v = rng.next_float(), luck = rng.next_float();
  const auto s = bsdf.sample_specular(choice, u, v, state.passage);
  if (!s) return {};
  ChainRay ray = chain_ray(bsdf, *s, throughput, pixel, rng, state);
  const float carried = max_component(ray.throughput);
  const float survive = state.bounces < kSureBounces && carried >= kSureWeight ? 1.0f : std::min(1.0f, carried);
  if (!(luck < survive)) return {};
  ray.throughput = ray.throughput / survive;
  return ray;
}

void start_chains(const Bsdf& bsdf, const Rgb& throughput, uint32_t pixel, Rng rng, const ChainRay::State& state,
                  std::vector<ChainRay>& chains) {
  if (!state.sure || state.bounces >= kSureBounces) {
    if (const auto ray = start_chain(bsdf, throughput, pixel, rng, state)) chains.push_back(*ray);
    return;
  }
  rng.next_float();
  const float u = rng.next_float(), v = rng.next_float();
  float luck = rng.next_float();
  const uint64_t seed = Rng(rng).next_u32();
  uint32_t ways = 0;
  for (const auto& s : bsdf.specular_ways(u, v, state.passage)) {
    if (!s) continue;
    if (ways > 0) rng = Rng(hash64(seed, ways), Stage::compensation), luck = rng.next_float();
    ++ways;
    ChainRay ray = chain_ray(bsdf, *s, throughput, pixel, rng, state);
    const float carried = max_component(ray.throughput);
    if (!(carried > 0.0f)) continue;
    const float survive = carried >= kSureWeight ? 1.0f : carried;
    ray.state.sure = (s->flags & kSharp) != 0;
    ray.boost = luck < survive ? 1.0f / survive : 0.0f;
    chains.push_back(ray);
  }
}

void follow_chains(const Scene& scene, const LightSurfaces& light_surfaces, std::vector<ChainRay> chains,
                   const Progress& progress, TracedPoints& hits, Counters& counters, bool direct) {
  std::vector<RayHit> rays;
  for (uint32_t depth = 0; depth < kMaxSurfaces && !chains.empty(); ++depth) {
    rays.assign(chains.size(), {});
    for (size_t i = 0; i < chains.size(); ++i)
      rays[i].ray.org = chains[i].origin, rays[i].ray.dir = chains[i].direction,
      rays[i].ray.mask = chains[i].state.kind;
    trace_in_parts(std::span(rays), progress, [&](std::span<RayHit> part) { scene.accel().intersect(part); });
    counters.rays += rays.size();
    std::vector<ChainRay> next;
    for (size_t i = 0; i < chains.size(); ++i) {
      if (i % 4096 == 0) progress.check();
      ChainRay& chain = chains[i];
      if (!light_surfaces.empty())
        light_surfaces.for_each_hit(
            chain.origin, chain.direction, rays[i].ray.tfar, [&](const LightSurfaces::Hit& seen) {
              const LightReach& reach = scene.lights()[seen.light].reach;
              if (!reach.lights(chain.state.kind) || !in_set(chain.state.not_lit_by, reach.receivers)) return;
              hits.add(chain.throughput * seen.radiance * chain.state.share, chain.pixel,
                       scene.lights()[seen.light].group, chain.state.sure);
            });
      if (rays[i].hit.geom == kNoId) {
        if (!scene.environment().reach.lights(chain.state.kind)) continue;
        const Rgb light = chain.throughput * scene.environment_radiance(chain.direction) * chain.state.share;
        if (max_component(light) > 0.0f) hits.add(light, chain.pixel, scene.environment().group, chain.state.sure);
        continue;
      }
      const SurfaceInteraction at = scene.interaction(rays[i], chain.pixel);
      chain.throughput *= at.bsdf.transmittance_to(at.t, chain.state.absorption);
      const Rgb light = chain.throughput * at.emitted * chain.state.share;
      if (max_component(light) > 0.0f) hits.add(light, chain.pixel, scene.meshes()[at.mesh].group, chain.state.sure);
      if (direct || chain.boost == 0.0f) continue;
      chain.throughput *= chain.boost;
      chain.state.sure = chain.state.sure && chain.boost == 1.0f;
      for (SurfacePoint point : at.bsdf.layers()) {
        point.attenuate(chain.throughput * chain.state.share);
        if (!PointBsdf(point).black()) hits.add(point, chain.state.sure);
      }
      start_chains(at.bsdf, chain.throughput, chain.pixel, chain.rng, chain.state, next);
    }
    chains = std::move(next);
  }
}

}  // namespace lumicut
