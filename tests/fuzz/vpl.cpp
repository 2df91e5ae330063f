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
    io::write_vpls(folder / "again.vpl", lights.data(), lights.size());
    const auto again = io::read_vpls(folder / "again.vpl");
    if (again.size() != lights.size() ||
        (!lights.empty() && std::memcmp(again.data(), lights.data(), lights.size() * sizeof(lights[0])) != 0))
      fuzz::finding("what was written does not read back the same");
    if (lumicut_integrator_set_lights(integrator.get(), lights.data(), lights.size()) == LUMICUT_INTERNAL)
      fuzz::finding(lumicut_last_error());
  } catch (const io::FileError&) {
  }
  return 0;
}
