// What an integrator prepared, saved and loaded again: the extension "lumicut.state/1".
#include "lumicut/lumicut_state.h"
#include "tests/fuzz/checked_bytes.h"
#include "tests/plugin/box_scene.h"

using namespace lumicut;

namespace {

constexpr fuzz::Layout kLayout = {72, 24, 16};  // plugin/capi_state.cpp

struct Subject {
  const lumicut_state_extension& extension =
      *static_cast<const lumicut_state_extension*>(lumicut_get_extension(LUMICUT_STATE_EXTENSION));
  api::Device device{1};
  api::Scene scene = box::scene(device);
  std::vector<uint8_t> good;

  Subject() {
    const api::Integrator integrator = box::integrator(device, 20, "wspd");
    api::check(lumicut_integrator_prepare(integrator.get(), scene.get()));
    uint64_t size = 0;
    api::check(extension.save(integrator.get(), nullptr, &size));
    good.resize(size);
    api::check(extension.save(integrator.get(), good.data(), &size));
    fuzz::check_layout(good, kLayout);
  }
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const Subject subject;
  const auto bytes = fuzz::edited(subject.good, kLayout, data, size);
  const api::Integrator integrator = box::integrator(subject.device, 20, "wspd");
  lumicut_result result = subject.extension.load(integrator.get(), subject.scene.get(), bytes.data(), bytes.size());
  if (result == LUMICUT_OK) {
    const auto desc = box::frame(4, 4);
    lumicut_render render = nullptr;
    result = lumicut_render_start(integrator.get(), subject.scene.get(), &desc, &render);
    if (result == LUMICUT_OK) result = lumicut_render_wait(render, LUMICUT_FOREVER, nullptr);
    lumicut_release(render);
  }
  if (result == LUMICUT_INTERNAL) fuzz::finding(lumicut_last_error());
  return 0;
}
