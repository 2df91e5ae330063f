// What mirrors and glass show: rays that follow specular lobes until surfaces that virtual lights can shade.
#pragma once

#include "core/stats.h"
#include "lights/light_surfaces.h"
#include "render/traced_points.h"
#include "scene/scene.h"

namespace lumicut {

struct ChainRay {
  Vec3f origin, direction;
  Rgb throughput{};
  uint32_t pixel = 0;
  Rng rng;
  // What is handed on from surface to surface.
  struct State {
    uint32_t bounces = 0;  // specular ones before
    Passage passage = Passage::refracted;
    uint32_t kind = kCameraRay;  // RayKind
    Rgb absorption{};            // on its way, for each unit of length
    uint32_t not_lit_by = 0;     // sets of receivers that the surface it left is not in
    float share = 1.0f;          // of what it brings, that counts
    bool sure = false;           // nothing on its way was left to chance: it came the one way or all ways are followed
  };
  State state;
  bool straight = false;  // it has just gone so
  float boost = 1.0f;     // of all but what shines at its end, by chance; 0: it ends there
};

// One ray that goes on from a surface with a specular lobe, by chance; `throughput`: of what the surface shows. The first
// bounces off mirrors are sure: a mirror is not peppered black. Chance keeps the others by what they carry.
// `state`: of the ray that came.
std::optional<ChainRay> start_chain(const Bsdf& bsdf, const Rgb& throughput, uint32_t pixel, Rng rng,
                                    const ChainRay::State& state);

// All ways that a sure ray goes on, while it is sure and has not met many surfaces; else one by chance. Of a way that
// carries little, chance decides whether it shows more than what shines.
void start_chains(const Bsdf& bsdf, const Rgb& throughput, uint32_t pixel, Rng rng, const ChainRay::State& state,
                  std::vector<ChainRay>& chains);

// Follows the rays to their ends; `direct`: to what shines at the first. Lights with an area are seen in mirrors, though not by the camera itself.
void follow_chains(const Scene& scene, const LightSurfaces& light_surfaces, std::vector<ChainRay> rays,
                   const Progress& progress, TracedPoints& hits, Counters& counters, bool direct = false);

}  // namespace lumicut
