#include "render/camera_rays.h"

#include "core/even_sequence.h"
#include "core/parallel.h"
#include "core/rng.h"

namespace lumicut {

namespace {

// In the pixel R2, on the lens two steps of R4, which no whole numbers relate to those: together they fill all four
// dimensions.
Vec2f on_lens(uint64_t i, Vec2f shift) { return rank1(i, shift, 0.8566748838545029, 0.7338918566271260); }

}  // namespace

CameraRays::CameraRays(const Camera& camera, const FrameOptions& options)
    : camera_(camera), options_(options), filter_(options.filter) {}

void CameraRays::of_pixel(uint32_t x, uint32_t y, RayHit* rays, float* cosines) const {
  const auto [seed, first] = options_.camera_samples.value_or(FrameOptions::CameraSamples{options_.seed, 0});
  Rng rng(seed, Stage::camera, x, y);
  // One sample lies at the centre; more are shifted by a random vector of the pixel's own.
  const bool centred = options_.samples == 1 && !options_.camera_samples;
  const Vec2f shift = centred ? Vec2f{0, 0} : Vec2f{rng.next_float(), rng.next_float()};
  const Vec2f lens_shift = {rng.next_float(), rng.next_float()};
  for (uint32_t s = 0; s < options_.samples; ++s) {
    const Vec2f at = even_point(first + s, shift), lens = on_lens(first + s, lens_shift);
    // The plain box as ever: x + u, which in floats is not (x + 1/2) + (u − 1/2).
    const Vec2f place =
        options_.filter == PixelFilter{} ? at : Vec2f{0.5f + filter_.offset(at.x), 0.5f + filter_.offset(at.y)};
    const Camera::Sample c =
        camera_.generate(static_cast<float>(x) + place.x, static_cast<float>(y) + place.y,
                         static_cast<float>(options_.width), static_cast<float>(options_.height), lens.x, lens.y);
    rays[s].ray.org = c.origin, rays[s].ray.dir = c.direction, rays[s].ray.tnear = c.tnear, rays[s].ray.tfar = c.tfar;
    rays[s].ray.mask = c.outside ? 0u : uint32_t{kCameraRay};
    cosines[s] = c.forward_cosine;
  }
}

void first_hits(const Scene& scene, const FrameOptions& options, const Rect& rect, std::span<FirstHit> hits,
                const Progress& progress) {
  const CameraRays camera(scene.camera(), options);
  const size_t samples = options.samples, pixels = size_t{rect.width()} * rect.height();
  parallel_chunks(pixels, std::max<size_t>(1, 1024 / samples), [&](size_t begin, size_t end) {
    if (progress.cancelled()) return;
    std::vector<RayHit> rays((end - begin) * samples);
    std::vector<float> cosines(samples);
    for (size_t p = begin; p < end; ++p)
      camera.of_pixel(rect.x0 + static_cast<uint32_t>(p % rect.width()),
                      rect.y0 + static_cast<uint32_t>(p / rect.width()), rays.data() + (p - begin) * samples,
                      cosines.data());
    if (!scene.bounds().empty()) scene.accel().intersect(rays);
    for (size_t i = 0; i < rays.size(); ++i) {
      FirstHit& out = hits[begin * samples + i];
      out = {kNoId, 0, 0, 0, 0.0f, 0.0f};
      if (rays[i].ray.mask == 0 || rays[i].hit.geom == kNoId) continue;
      const SurfaceHit s = scene.surface(rays[i], false);
      out = {s.mesh, s.instance, s.triangle, s.material, s.u, s.v};
    }
  });
  progress.check();
}

}  // namespace lumicut
