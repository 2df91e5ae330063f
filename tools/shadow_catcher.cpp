#include "tools/shadow_catcher.h"

#include <algorithm>

namespace lumicut::tools {

bool has_catchers(const io::SceneData& data) {
  return std::ranges::any_of(data.meshes, [](const io::Mesh& mesh) { return mesh.shadow_catcher; });
}

bool shows_world(const io::SceneData& data) {
  return data.environment && (data.environment->flags & LUMICUT_HIDDEN) == 0;
}

namespace {

// Each changes `data`, so that nothing big is copied.

// The second half of the materials is the first as holes to the camera.
void leave_objects(io::SceneData& data) {
  const auto count = static_cast<uint32_t>(data.materials.size());
  data.materials.reserve(size_t{2} * count);
  for (uint32_t i = 0; i < count; ++i) {
    data.materials.push_back(data.materials[i]);
    data.materials.back().values.flags |= LUMICUT_HOLDOUT;
  }
  for (io::Mesh& mesh : data.meshes)
    if (mesh.shadow_catcher)
      for (uint32_t& material : mesh.materials) material += count;
  if (data.environment) data.environment->flags |= LUMICUT_HIDDEN;
}

// Of what leave_objects left.
void leave_catchers(io::SceneData& data) {
  const auto count = static_cast<uint32_t>(data.materials.size() / 2);
  std::erase_if(data.meshes, [](const io::Mesh& mesh) {
    return !mesh.shadow_catcher && mesh.mask != 0 && (mesh.mask & LUMICUT_CAMERA_RAYS) == 0;
  });
  for (io::Mesh& mesh : data.meshes) {
    for (uint32_t& material : mesh.materials) material = mesh.shadow_catcher ? material - count : material + count;
    if (!mesh.shadow_catcher) mesh.mask = LUMICUT_CAMERA_RAYS;
  }
  std::vector<lumicut_light> lights;
  std::vector<std::string> names;
  for (size_t i = 0; i < data.lights.size(); ++i)
    if (data.lights_of_catchers.contains(i)) lights.push_back(data.lights[i]), names.push_back(data.light_names[i]);
  data.lights = std::move(lights), data.light_names = std::move(names);
}

void leave_world(io::SceneData& data) { data.meshes.clear(), data.lights.clear(), data.light_names.clear(); }

}  // namespace

void for_each_beside(io::SceneData data, const std::function<void(const io::SceneData&)>& use) {
  const bool with_world = shows_world(data);
  const auto environment = data.environment;
  leave_objects(data), use(data);
  data.environment = environment;
  leave_catchers(data), use(data);
  if (with_world) leave_world(data), use(data);
}

namespace {

// What is left of the catchers' light, in each colour: 1 where there is none of them. `cover`: of all objects.
void shade(const float* whole, const float* objects, const float* clean, float cover, float* left) {
  float sum = 0.0f;
  int known = 0;
  for (int c = 0; c < 3; ++c) {
    left[c] = clean[c] > 0.0f ? (whole[c] - objects[c]) / clean[c] : 0.0f;
    if (clean[c] > 0.0f) sum += left[c], ++known;
  }
  for (int c = 0; c < 3; ++c) {
    // A colour that does not light the catcher goes by the others.
    if (!(clean[c] > 0.0f)) left[c] = known > 0 ? sum / static_cast<float>(known) : 1.0f;
    left[c] = 1.0f - cover + cover * left[c];
  }
}

}  // namespace

void lay_shadows(std::span<const Caught> beside, Caught& whole) {
  const Caught &objects = beside[0], &catchers = beside[1];
  const Caught* world = beside.size() > 2 ? &beside[2] : nullptr;
  for (size_t p = 0; p < whole.alpha.size(); ++p) {
    float left[3];
    shade(&whole.radiance[3 * p], &objects.radiance[3 * p], &catchers.radiance[3 * p],
          world != nullptr ? 1.0f : whole.alpha[p], left);
    const float mean = std::clamp((left[0] + left[1] + left[2]) / 3.0f, 0.0f, 1.0f);
    const float covered = objects.alpha[p] + (1.0f - objects.alpha[p]) * (1.0f - mean);
    for (size_t c = 3 * p; c < 3 * p + 3; ++c) {
      const float behind = world != nullptr ? world->radiance[c] * (1.0f - covered) : 0.0f;
      whole.radiance[c] = objects.radiance[c] + behind;
      if (!whole.denoised.empty()) whole.denoised[c] = objects.denoised[c] + behind;
    }
    whole.alpha[p] = covered;
  }
}

}  // namespace lumicut::tools
