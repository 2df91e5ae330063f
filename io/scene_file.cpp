#include "io/scene_file.h"

#include "io/scene_gltf.h"
#include "io/scene_json.h"
#include "io/scene_mitsuba.h"
#include "io/scene_model.h"
#include "io/scene_pbrt.h"

namespace lumicut::io {

SceneData read_scene_file(const std::string& path) {
  if (is_gltf(path)) return read_gltf(path);
  if (is_model(path)) return read_model(path);
  if (is_pbrt(path)) return read_pbrt(path);
  if (is_mitsuba(path)) return read_mitsuba(path);
  return read_scene(path);
}

}  // namespace lumicut::io
