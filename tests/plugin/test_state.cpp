// Extension lumicut.state/1: prepared once, saved as memory, loaded by another integrator.
#include <cstring>

#include "box_scene.h"
#include "lumicut/lumicut_lights.h"
#include "lumicut/lumicut_state.h"

namespace {

using namespace box;

const lumicut_state_extension& extension() {
  return *static_cast<const lumicut_state_extension*>(lumicut_get_extension(LUMICUT_STATE_EXTENSION));
}

std::vector<uint8_t> save(const api::Integrator& i) {
  uint64_t size = 0;
  EXPECT_EQ(extension().save(i.get(), nullptr, &size), LUMICUT_OK) << lumicut_last_error();
  std::vector<uint8_t> bytes(size);
  EXPECT_EQ(extension().save(i.get(), bytes.data(), &size), LUMICUT_OK) << lumicut_last_error();
  EXPECT_EQ(size, bytes.size());
  return bytes;
}

lumicut_result load(const api::Integrator& i, const api::Scene& s, const std::vector<uint8_t>& bytes) {
  return extension().load(i.get(), s.get(), bytes.data(), bytes.size());
}

bool reused(const api::Render& r) {
  return std::string(lumicut_stats_json(r.get())).find("prepare_reused") != std::string::npos;
}

TEST(State, ExtensionIsFoundByItsNameAlone) {
  ASSERT_NE(lumicut_get_extension(LUMICUT_STATE_EXTENSION), nullptr);
  EXPECT_EQ(extension().struct_size, sizeof(lumicut_state_extension));
  EXPECT_EQ(lumicut_get_extension("lumicut.state/2"), nullptr);
  EXPECT_EQ(lumicut_get_extension(nullptr), nullptr);
}

TEST(State, LoadedStateRendersTheSameImageWithoutAnyPreparation) {
  const api::Device device(2);
  const api::Scene s = scene(device);
  api::Integrator first = integrator(device, 2000, "wspd");
  const auto image = render(first, s);
  const auto bytes = save(first);
  EXPECT_EQ(save(first), bytes);

  // Another device, as in a later run.
  const api::Device later(1);
  const api::Scene same = scene(later);
  const api::Integrator second = integrator(later, 2000, "wspd");
  ASSERT_EQ(load(second, same, bytes), LUMICUT_OK) << lumicut_last_error();
  const api::Render r(second, same, frame());
  r.wait();
  EXPECT_TRUE(reused(r));
  EXPECT_EQ(r.read("radiance"), image);
  EXPECT_EQ(save(second), bytes);
  EXPECT_EQ(second.lights().size(), first.lights().size());
}

// A state serves all cameras, and its lights would be for one.
TEST(State, IsRefusedWithImportance) {
  const api::Device device(2);
  const api::Scene s = scene(device);
  api::Integrator i = integrator(device, 500, "wspd");
  render(i, s);
  const auto bytes = save(i);
  ASSERT_EQ(lumicut_integrator_set(i.get(), "importance", "true"), LUMICUT_OK);
  EXPECT_EQ(load(i, s, bytes), LUMICUT_INVALID_ARGUMENT);
  EXPECT_NE(std::string(lumicut_last_error()).find("importance"), std::string::npos);
  render(i, s);
  uint64_t size = 0;
  EXPECT_EQ(extension().save(i.get(), nullptr, &size), LUMICUT_INVALID_ARGUMENT);
  // Nor do origins tell with which chances such lights were drawn.
  const auto& lights = *static_cast<const lumicut_lights_extension*>(lumicut_get_extension(LUMICUT_LIGHTS_EXTENSION));
  lumicut_vpl_set set{};
  set.struct_size = sizeof(set);
  EXPECT_EQ(lights.get(i.get(), &set), LUMICUT_INVALID_ARGUMENT);
  EXPECT_GT(i.lights().size(), 0u);
}

TEST(State, OfSpheresRendersTheSameImage) {
  const api::Device device(2);
  const api::Scene s = scene(device);
  api::Integrator first = integrator(device, 1000, "wspd"), second = integrator(device, 1000, "wspd"),
                  points = integrator(device, 1000, "wspd");
  first.set("virtual_lights", "spheres"), second.set("virtual_lights", "spheres");
  const auto image = render(first, s);
  const auto bytes = save(first);
  ASSERT_EQ(load(second, s, bytes), LUMICUT_OK) << lumicut_last_error();
  EXPECT_EQ(render(second, s), image);
  EXPECT_CODE(load(points, s, bytes), LUMICUT_INVALID_ARGUMENT, "virtual_lights=spheres");
}

TEST(State, OfRoughSurfacesRendersTheSameImageWithPointsAndSpheres) {
  const api::Device device(2);
  api::Scene s = scene(device, false);
  s.set_materials(rough_materials());
  s.commit();
  for (const char* kind : {"points", "spheres"}) {
    api::Integrator first = integrator(device, 1000, "wspd"), second = integrator(device, 1000, "wspd");
    first.set("virtual_lights", kind), second.set("virtual_lights", kind);
    const auto image = render(first, s);
    ASSERT_EQ(load(second, s, save(first)), LUMICUT_OK) << kind << ": " << lumicut_last_error();
    EXPECT_EQ(render(second, s), image) << kind;
  }
}

TEST(State, AnotherCameraUsesWhatWasPrepared) {
  const api::Device device(2);
  api::Scene s = scene(device);
  const api::Integrator i = integrator(device, 1000, "wspd");
  const auto first = render(i, s);
  auto turned = camera();
  turned.to_world[3] = 0.3f;
  s.set_camera(turned);
  s.commit();
  const api::Render r(i, s, frame());
  r.wait();
  EXPECT_TRUE(reused(r));
  EXPECT_NE(r.read("radiance"), first);
}

TEST(State, HostLightsTravelWithTheState) {
  const api::Device device(1);
  const api::Scene s = scene(device);
  const auto lights = [&] {
    const api::Integrator source = integrator(device, 500);
    render(source, s);
    return source.lights();
  }();
  api::Integrator first(device, "wspd");
  first.set_lights(lights);
  const auto image = render(first, s);
  const api::Integrator second(device, "wspd");
  ASSERT_EQ(load(second, s, save(first)), LUMICUT_OK) << lumicut_last_error();
  EXPECT_EQ(render(second, s), image);
  EXPECT_EQ(second.lights().size(), lights.size());
}

TEST(State, WrongBytesAreRefusedByNameAndChangeNothing) {
  const api::Device device(1);
  const api::Scene s = scene(device);
  const api::Integrator i = integrator(device, 300, "wspd");
  const auto image = render(i, s);
  const auto good = save(i);

  for (size_t keep = 0; keep < good.size(); keep += 1 + good.size() / 100)
    EXPECT_EQ(load(i, s, {good.begin(), good.begin() + static_cast<std::ptrdiff_t>(keep)}), LUMICUT_INVALID_ARGUMENT);
  for (size_t at = 0; at < good.size(); at += at < 200 ? 1 : 1 + good.size() / 200) {
    auto bad = good;
    bad[at] ^= 0x10;
    EXPECT_EQ(load(i, s, bad), LUMICUT_INVALID_ARGUMENT) << "byte " << at;
  }
  auto bad = good;
  bad[0] ^= 1;
  EXPECT_CODE(load(i, s, bad), LUMICUT_INVALID_ARGUMENT, "no saved state");
  bad = good, bad[8] = 9;
  EXPECT_CODE(load(i, s, bad), LUMICUT_INVALID_ARGUMENT, "version 9");
  bad = good, bad.pop_back();
  EXPECT_CODE(load(i, s, bad), LUMICUT_INVALID_ARGUMENT, "bytes long instead of");
  bad = good, bad.back() ^= 1;
  EXPECT_CODE(load(i, s, bad), LUMICUT_INVALID_ARGUMENT, "checksum");
  EXPECT_CODE(extension().load(i.get(), s.get(), nullptr, 5), LUMICUT_INVALID_ARGUMENT, "bytes is NULL");
  EXPECT_EQ(render(i, s), image);

  api::Integrator other = integrator(device, 300, "wspd");
  other.set("separation", "0.5");
  EXPECT_CODE(load(other, s, good), LUMICUT_INVALID_ARGUMENT, "separation=0.25");
  EXPECT_CODE(load(integrator(device, 300, "lightcuts"), s, good), LUMICUT_INVALID_ARGUMENT, "of \"wspd\"");
  api::Scene moved(device);
  Geometry g = geometry();
  g.positions[0] += 0.1f;
  moved.set_materials(materials());
  moved.add_mesh(g.mesh());
  moved.set_lights({lamp()});
  moved.set_camera(camera());
  moved.commit();
  EXPECT_CODE(load(i, moved, good), LUMICUT_INVALID_ARGUMENT, "other geometry");
}

TEST(State, WhatHasNoStateSaysSo) {
  const api::Device device(1);
  const api::Scene s = scene(device);
  uint64_t size = 0;
  const api::Integrator fresh = integrator(device, 300, "wspd");
  EXPECT_CODE(extension().save(fresh.get(), nullptr, &size), LUMICUT_INVALID_STATE, "nothing is prepared");
  api::Integrator plain = integrator(device, 300);
  plain.prepare(s);
  EXPECT_CODE(extension().save(plain.get(), nullptr, &size), LUMICUT_UNSUPPORTED, "no state");
  api::Integrator i = integrator(device, 300, "wspd");
  i.prepare(s);
  EXPECT_CODE(extension().save(i.get(), nullptr, nullptr), LUMICUT_INVALID_ARGUMENT, "size is NULL");
  uint8_t byte = 0;
  size = 1;
  EXPECT_CODE(extension().save(i.get(), &byte, &size), LUMICUT_INVALID_ARGUMENT, "less than");
}

}  // namespace
