// The meshes of the benchmark: real ones from LUMICUT_SCENES, and generated ones.
#pragma once

#include <string>
#include <vector>

#include "bench/smoke.h"
#include "core/vec.h"

namespace lumicut::bench {

struct BenchMesh {
  std::string name;
  std::vector<Vec3f> positions;
  std::vector<uint32_t> indices;
  size_t triangles() const { return indices.size() / 3; }
};

// The folder of scenes: LUMICUT_SCENES, else ../shared/scenes beside the project. Empty when there is none.
std::string scenes_folder();

// Wavefront OBJ. No triangles when the file cannot be read.
BenchMesh load_obj(const std::string& folder, const std::string& name);

// Random triangles of mixed size; `seed` names them.
BenchMesh soup(size_t triangles, uint64_t seed);
// A bumpy closed surface, as a scan would be.
BenchMesh scan(size_t triangles);
// Boxes in boxes: rooms with furniture of boxes, large flat triangles beside small ones.
BenchMesh house(size_t triangles, uint64_t seed);

}  // namespace lumicut::bench
