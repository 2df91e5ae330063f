// Whole frames: camera rays → points → integrator → film, in batches, so that memory does not grow with resolution.
#pragma once

#include <functional>
#include <optional>
#include <span>

#include "film/film.h"
#include "film/pixel_filter.h"
#include "integrators/integrator.h"
#include "render/clamp.h"
#include "render/glint_guide.h"
#include "render/nearby_lights.h"
#include "render/traced_gloss.h"

namespace lumicut {

struct FrameOptions {
  uint32_t width = 0, height = 0, samples = 1, tile_size = 64;
  Rect crop;  // inside width × height
  uint64_t seed = 1;
  // Of a render in iterations: samples go on from here in the pixel's sequence, and a single one lies at random too.
  struct CameraSamples {
    uint64_t seed;  // the same in all passes
    uint64_t first;
    LUMICUT_FIELDS(CameraSamples, seed, first)
  };
  std::optional<CameraSamples> camera_samples;
  bool illuminance = false;  // fill that channel: about as long again
  bool denoise = false;      // fill the channels of denoising
  PixelFilter filter;
  uint32_t lobes = 0;      // RayKind: what these of the first surfaces show, alone; 0: all
  bool direct = false;     // light alone that comes straight from what emits
  float occlusion = 0.0f;  // above 0: the image is ambient occlusion within this distance
  LUMICUT_FIELDS(FrameOptions, width, height, samples, tile_size, crop, seed, camera_samples, illuminance, denoise,
                 filter, lobes, direct, occlusion)
};

// Tiles of the crop in the order they are rendered.
std::vector<Rect> frame_tiles(const FrameOptions& options);

// What renders the light of one group.
struct GroupMethod {
  uint32_t group;
  const Integrator* method;  // null: the group has no virtual lights
  // Where rays bring a part of the gloss of some lights, those lights and the others apart: of points with such gloss.
  const Integrator* traced = nullptr;
  const Integrator* others = nullptr;
  bool traces() const { return traced != nullptr; }
};

// What brings light beside the virtual lights. All outlive the frame.
struct FrameLight {
  const NearbyLights* nearby = nullptr;  // null: the clamp keeps what it takes from emitters
  const Clamp* compensated = nullptr;    // its loss is brought back by rays; null: it is not
  std::span<const uint8_t> rays = {};    // of those, from each point of a pixel of the crop; none: one
  const GlintGuide* glints = nullptr;    // where half of them go; null: by the points' lobes all
  bool spheres = false;                  // virtual lights are, and lose nothing by it
  bool trace_gloss = false;              // rays bring a part of the gloss of bounced light [traced_gloss.h]
  const EvenSky* sky = nullptr;          // and of this of the environment
};

// Light groups that something of the scene belongs to that emits, rising.
std::vector<uint32_t> light_groups(const Scene& scene);

// Renders into `film` (whose crop is options.crop), whose groups are those of `methods`, or none where there is one method
// for all light. `tile_done` is called from any thread, once a tile, after its pixels are written. Throws Error(cancelled).
void render_frame(const Scene& scene, std::span<const GroupMethod> methods, const FrameOptions& options,
                  const FrameLight& light, Film& film, ShadeContext context,
                  const std::function<void(const Rect&)>& tile_done);

}  // namespace lumicut
