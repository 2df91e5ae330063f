// Extension "lumicut.hits/1": what camera rays meet first.
#include "plugin/check.h"
#include "plugin/convert.h"
#include "plugin/descriptors.h"
#include "plugin/extensions.h"
#include "plugin/include/lumicut/lumicut_hits.h"
#include "plugin/objects.h"
#include "render/camera_rays.h"

using namespace lumicut;

namespace {

static_assert(sizeof(lumicut_first_hit) == sizeof(FirstHit) &&
              offsetof(lumicut_first_hit, material) == offsetof(FirstHit, material) &&
              offsetof(lumicut_first_hit, v) == offsetof(FirstHit, v));

lumicut_result trace(lumicut_scene scene, const lumicut_render_desc* frame, uint64_t seed, uint64_t pass,
                     const lumicut_tile* rect, lumicut_first_hit* hits) {
  return guard([&] {
    lumicut_scene_t& s = object(scene);
    const AccessGuard::Hold reading = s.gate.read("lumicut_hits_extension.trace");
    s.require_committed();
    if (!s.scene.has_camera()) fail_state("lumicut_scene: it has no camera");
    if (hits == nullptr) fail_argument("lumicut_hits_extension.trace: hits is NULL");
    const lumicut_render_desc desc = read(frame);
    FrameOptions options = to_frame_options(desc);
    options.seed = seed;
    if (desc.passes != 1) options.camera_samples = {seed, pass * options.samples};
    const Rect part = part_of(options.crop, rect);
    const size_t count = size_t{part.width()} * part.height() * options.samples;
    const std::shared_ptr<Progress> progress = s.work.share();
    const CurrentWork current(progress.get());
    s.device->arena.run([&] {
      first_hits(s.scene, options, part, {reinterpret_cast<FirstHit*>(hits), count}, *progress);
    });
    progress->check();
  });
}

const lumicut_hits_extension kTable = {sizeof(lumicut_hits_extension), 0, trace};

}  // namespace

namespace lumicut {

const void* hits_extension() { return &kTable; }

}  // namespace lumicut
