// A small closed room through the C ABI, as a host would build it: five walls, two blocks, one lamp.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "lumicut/lumicut.hpp"
#include "lumicut/lumicut_programs.h"

namespace box {

namespace api = lumicut::api;
using api::make;

struct Geometry {
  std::vector<float> positions;
  std::vector<uint32_t> indices, materials;

  void quad(const std::array<std::array<float, 3>, 4>& corners, uint32_t material) {
    const auto first = static_cast<uint32_t>(positions.size() / 3);
    for (const auto& c : corners) positions.insert(positions.end(), c.begin(), c.end());
    for (const uint32_t i : {0u, 1u, 2u, 0u, 2u, 3u}) indices.push_back(first + i);
    materials.insert(materials.end(), {material, material});
  }
  void block(std::array<float, 3> lo, std::array<float, 3> hi, uint32_t material) {
    const auto [x0, y0, z0] = lo;
    const auto [x1, y1, z1] = hi;
    quad({{{x0, y0, z1}, {x1, y0, z1}, {x1, y1, z1}, {x0, y1, z1}}}, material);
    quad({{{x0, y0, z0}, {x0, y1, z0}, {x1, y1, z0}, {x1, y0, z0}}}, material);
    quad({{{x0, y0, z0}, {x1, y0, z0}, {x1, y0, z1}, {x0, y0, z1}}}, material);
    quad({{{x0, y1, z0}, {x0, y1, z1}, {x1, y1, z1}, {x1, y1, z0}}}, material);
    quad({{{x0, y0, z0}, {x0, y0, z1}, {x0, y1, z1}, {x0, y1, z0}}}, material);
    quad({{{x1, y0, z0}, {x1, y1, z0}, {x1, y1, z1}, {x1, y0, z1}}}, material);
  }

  lumicut_mesh mesh() const {
    auto m = make<lumicut_mesh>();
    m.positions = positions.data();
    m.vertex_count = positions.size() / 3;
    m.indices = indices.data();
    m.triangle_count = indices.size() / 3;
    m.materials = materials.data();
    return m;
  }
};

// [-1,1]² in x and y, open at z = 0 where the camera looks in from, back wall at z = -2.
inline Geometry geometry() {
  Geometry g;
  g.quad({{{-1, -1, 0}, {1, -1, 0}, {1, -1, -2}, {-1, -1, -2}}}, 0);
  g.quad({{{-1, 1, 0}, {-1, 1, -2}, {1, 1, -2}, {1, 1, 0}}}, 0);
  g.quad({{{-1, -1, -2}, {1, -1, -2}, {1, 1, -2}, {-1, 1, -2}}}, 0);
  g.quad({{{-1, -1, 0}, {-1, -1, -2}, {-1, 1, -2}, {-1, 1, 0}}}, 1);
  g.quad({{{1, -1, 0}, {1, 1, 0}, {1, 1, -2}, {1, -1, -2}}}, 2);
  g.block({-0.6f, -1, -1.6f}, {-0.1f, 0.2f, -1.1f}, 0);
  g.block({0.2f, -1, -1.0f}, {0.6f, -0.5f, -0.6f}, 3);
  return g;
}

inline std::vector<lumicut_material> materials() {
  std::vector<lumicut_material> m(4, make<lumicut_material>());
  const float diffuse[4][3] = {{0.7f, 0.7f, 0.7f}, {0.6f, 0.1f, 0.1f}, {0.1f, 0.6f, 0.1f}, {0.2f, 0.2f, 0.5f}};
  for (int i = 0; i < 4; ++i) std::copy(diffuse[i], diffuse[i] + 3, m[i].diffuse);
  m[3].shininess = 20;
  m[3].specular[0] = m[3].specular[1] = m[3].specular[2] = 0.4f;
  return m;
}

// The same, none of them Lambert's.
inline std::vector<lumicut_material> rough_materials() {
  std::vector<lumicut_material> m = materials();
  for (lumicut_material& material : m) material.flags |= LUMICUT_OREN_NAYAR, material.roughness = 0.8f;
  return m;
}

inline lumicut_light lamp() {
  auto l = make<lumicut_light>();
  l.type = LUMICUT_RECTANGLE;
  l.unit = LUMICUT_WATT;
  l.color[0] = l.color[1] = l.color[2] = 1;
  l.value = 20;
  l.position[1] = 0.99f, l.position[2] = -1;
  l.u[0] = 0.5f, l.v[2] = 0.5f;  // u × v points down
  return l;
}

inline lumicut_camera camera() {
  auto c = make<lumicut_camera>();
  c.to_world[0] = c.to_world[5] = c.to_world[10] = 1;
  // A little off the middle, so that no pixel's centre looks right at an edge of the room.
  c.to_world[3] = 0.013f, c.to_world[7] = 0.007f, c.to_world[11] = 2.2f;
  c.fov_y = 0.9f;
  return c;
}

inline api::Scene scene(const api::Device& device, bool commit = true) {
  api::Scene s(device);
  s.set_materials(materials());
  s.add_mesh(geometry().mesh());
  s.set_lights({lamp()});
  s.set_camera(camera());
  if (commit) s.commit();
  return s;
}

inline api::Integrator integrator(const api::Device& device, int vpls = 400, const char* id = "exhaustive") {
  api::Integrator i(device, id);
  i.set("vpls", std::to_string(vpls));
  return i;
}

inline std::vector<std::string> integrator_ids() {
  std::vector<std::string> ids;
  for (const auto& info : api::integrators()) ids.emplace_back(info.id);
  return ids;
}

inline bool has_virtual_lights(const std::string& id) {
  for (const auto& info : api::integrators())
    if (id == info.id) return (info.traits & LUMICUT_VIRTUAL_LIGHTS) != 0;
  return false;
}

inline lumicut_render_desc frame(uint32_t width = 48, uint32_t height = 32) {
  auto d = make<lumicut_render_desc>();
  d.width = width, d.height = height, d.tile_size = 16;
  return d;
}

inline std::vector<float> render(const api::Integrator& integrator, const api::Scene& scene,
                                 const lumicut_render_desc& desc = frame()) {
  const api::Render r(integrator, scene, desc);
  r.wait();
  return r.read("radiance");
}

inline double mean(const std::vector<float>& v) {
  double sum = 0;
  for (const float f : v) sum += f;
  return v.empty() ? 0.0 : sum / static_cast<double>(v.size());
}

}  // namespace box

#define EXPECT_CODE(call, expected_code, text)                                                          \
  do {                                                                                                  \
    EXPECT_EQ((call), (expected_code)) << lumicut_last_error();                                         \
    EXPECT_NE(std::string(lumicut_last_error()).find(text), std::string::npos) << lumicut_last_error(); \
  } while (false)
