#include "bench/bvh/meshes.h"

#include <cmath>
#include <cstdlib>
#include <filesystem>

#include "core/rng.h"
#include "io/file_error.h"
#include "io/scene_obj.h"

namespace lumicut::bench {

std::string scenes_folder() {
  const char* named = std::getenv("LUMICUT_SCENES");
  const std::string folder = named != nullptr ? named : LUMICUT_SOURCE_DIR "/../shared/scenes";
  return std::filesystem::is_directory(folder) ? folder : "";
}

BenchMesh load_obj(const std::string& folder, const std::string& name) {
  BenchMesh mesh;
  mesh.name = name;
  const std::filesystem::path path = std::filesystem::path(folder) / name / (name + ".obj");
  io::Mesh read;
  try {
    io::Warnings warnings;
    read = io::read_obj_positions(path.string(), warnings);
  } catch (const io::FileError&) {
    return mesh;
  }
  for (size_t i = 0; i + 2 < read.positions.size(); i += 3)
    mesh.positions.push_back({read.positions[i], read.positions[i + 1], read.positions[i + 2]});
  mesh.indices = std::move(read.indices);
  return mesh;
}

BenchMesh soup(size_t triangles, uint64_t seed) {
  BenchMesh mesh;
  mesh.name = "soup " + std::to_string(triangles / 1000) + "K";
  Rng rng(seed, Stage::test);
  const auto point = [&] { return Vec3f{rng.next_float(), rng.next_float(), rng.next_float()}; };
  const float scale = 1.5f / std::cbrt(static_cast<float>(triangles));
  for (size_t i = 0; i < triangles; ++i) {
    const Vec3f c = point();
    const float size = scale * std::pow(rng.next_float(), 2.0f);
    for (int k = 0; k < 3; ++k) {
      mesh.indices.push_back(static_cast<uint32_t>(mesh.positions.size()));
      mesh.positions.push_back(c + (point() - Vec3f{0.5f, 0.5f, 0.5f}) * size);
    }
  }
  return mesh;
}

BenchMesh scan(size_t triangles) {
  BenchMesh mesh;
  mesh.name = "scan " + std::to_string(triangles / 1000) + "K";
  const auto stacks = static_cast<uint32_t>(std::sqrt(static_cast<double>(triangles) / 4.0));
  const uint32_t slices = 2 * stacks;
  for (uint32_t i = 0; i <= stacks; ++i)
    for (uint32_t j = 0; j <= slices; ++j) {
      const float theta = 3.14159265f * static_cast<float>(i) / static_cast<float>(stacks);
      const float phi = 6.2831853f * static_cast<float>(j) / static_cast<float>(slices);
      const Vec3f n{std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)};
      const float bump = 1.0f + 0.15f * std::sin(7.0f * n.x) * std::sin(5.0f * n.y + 1.0f) +
                         0.02f * std::sin(60.0f * n.z + 40.0f * n.x);
      mesh.positions.push_back(n * bump);
    }
  for (uint32_t i = 0; i < stacks; ++i)
    for (uint32_t j = 0; j < slices; ++j) {
      const uint32_t a = i * (slices + 1) + j, b = a + slices + 1;
      mesh.indices.insert(mesh.indices.end(), {a, b, b + 1, a, b + 1, a + 1});
    }
  return mesh;
}

BenchMesh house(size_t triangles, uint64_t seed) {
  BenchMesh mesh;
  mesh.name = "house " + std::to_string(triangles / 1000) + "K";
  Rng rng(seed, Stage::test);
  const auto add_box = [&](const Vec3f& lo, const Vec3f& hi) {
    const auto first = static_cast<uint32_t>(mesh.positions.size());
    for (int c = 0; c < 8; ++c)
      mesh.positions.push_back({c & 1 ? hi.x : lo.x, c & 2 ? hi.y : lo.y, c & 4 ? hi.z : lo.z});
    for (const int i :
         {0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4, 2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5})
      mesh.indices.push_back(first + static_cast<uint32_t>(i));
  };
  const auto rooms = static_cast<size_t>(std::cbrt(static_cast<double>(triangles) / 2000.0)) + 1;
  const size_t per_room = triangles / 12 / (rooms * rooms * rooms);
  const float wall = 0.01f;
  for (size_t room = 0; room < rooms * rooms * rooms; ++room) {
    const Vec3f o{static_cast<float>(room % rooms), static_cast<float>(room / rooms % rooms),
                  static_cast<float>(room / rooms / rooms)};
    add_box(o, o + Vec3f{1, 1, wall});
    add_box(o, o + Vec3f{1, wall, 0.7f});
    add_box(o, o + Vec3f{wall, 0.8f, 1});
    for (size_t i = 3; i < per_room; ++i) {
      const Vec3f size{0.15f * rng.next_float() * rng.next_float(), 0.15f * rng.next_float() * rng.next_float(),
                       0.3f * rng.next_float() * rng.next_float()};
      const Vec3f at =
          o +
          Vec3f{rng.next_float(), rng.next_float(), wall + (rng.next_float() < 0.7f ? 0.0f : rng.next_float())} * 0.8f;
      add_box(at, at + size);
    }
  }
  return mesh;
}

}  // namespace lumicut::bench
