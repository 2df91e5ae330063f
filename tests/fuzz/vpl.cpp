// Files of virtual lights, in our format and the peer's; what was read is written and read again unchanged, and the
// library takes it or says why not.
#include "io/vpl_file.h"

#include <cstring>

#include "io/file_error.h"
#include "lumicut/lumicut.hpp"
#include "tests/fuzz/fuzz.h"

using namespace lumicut;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const fuzz::Folder folder;
  static const api::Device device(1);
  static const api::Integrator integrator(device, "exhaustive");
  try {
    const auto lights = io::read_vpls(folder.write("lights.vpl", fuzz::text_of(data, size)));
    io::write_vpls(folder / "again.vpl", lights);
    const auto again = io::read_vpls(folder / "again.vpl");
    const auto same = [](const auto& a, const auto& b) {
      return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(a[0])) == 0);
    };
    if (!same(again.lights, lights.lights) || !same(again.origins, lights.origins) ||
        again.light_paths != lights.light_paths || again.emitter_samples != lights.emitter_samples)
      fuzz::finding("what was written does not read back the same");
    api::set_vpls(integrator.get(), lights);
  } catch (const api::Exception& error) {
    if (error.code() == LUMICUT_INTERNAL) fuzz::finding(error.what());
  } catch (const io::FileError&) {
  }
  return 0;
}
