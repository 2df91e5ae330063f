// Photometric files: read, and made into the profile that a light has.
#include "io/ies_file.h"

#include "io/file_error.h"
#include "tests/fuzz/fuzz.h"

using namespace lumicut;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  try {
    io::Warnings warnings;
    const io::IesProfile profile = io::parse_ies(std::string(fuzz::text_of(data, size)), "lamp.ies", warnings);
    if (profile.candela.size() != profile.vertical.size() * profile.horizontal.size())
      fuzz::finding("the table does not fit its angles");
    profile.lumens();
  } catch (const io::FileError&) {
  }
  return 0;
}
