// Checkpoints of a render: read back, and rendered on.
#include "tests/fuzz/checked_bytes.h"
#include "tests/plugin/box_scene.h"

using namespace lumicut;

namespace {

constexpr fuzz::Layout kLayout = {56, 16};  // render/checkpoint.cpp

lumicut_render_desc frame() {
  auto desc = box::frame(6, 4);
  desc.passes = 3;
  desc.flags = LUMICUT_CHECKPOINTS | LUMICUT_GROUPS;
  return desc;
}

struct Subject {
  api::Device device{1};
  api::Scene scene = box::scene(device);
  api::Integrator integrator = box::integrator(device, 20, "lightcuts");
  std::vector<uint8_t> good;

  Subject() {
    auto desc = frame();
    desc.passes = 2;
    const api::Render render(integrator, scene, desc);
    render.wait();
    const void* data = nullptr;
    uint64_t size = 0;
    api::check(lumicut_render_checkpoint(render.get(), &data, &size));
    good.assign(static_cast<const uint8_t*>(data), static_cast<const uint8_t*>(data) + size);
    fuzz::check_layout(good, kLayout);
  }
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const Subject subject;
  const auto bytes = fuzz::edited(subject.good, kLayout, data, size);
  auto desc = frame();
  desc.checkpoint = bytes.data(), desc.checkpoint_size = bytes.size();
  lumicut_render render = nullptr;
  lumicut_result result = lumicut_render_start(subject.integrator.get(), subject.scene.get(), &desc, &render);
  if (result == LUMICUT_OK) {
    result = lumicut_render_wait(render, LUMICUT_FOREVER, nullptr);
    std::vector<float> pixels(3 * 6 * 4);
    if (result == LUMICUT_OK) lumicut_render_read(render, "radiance", nullptr, pixels.data());
    lumicut_release(render);
  }
  if (result == LUMICUT_INTERNAL) fuzz::finding(lumicut_last_error());
  return 0;
}
