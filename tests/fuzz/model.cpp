// FBX, COLLADA and PLY files; the first byte chooses. assimp runs in a process of its own, whose end is an error like any
// other: what is held here is that the command's own process goes on, and what it makes of the answer.
#include "io/file_error.h"
#include "io/scene_model.h"
#include "tests/fuzz/fuzz.h"
#include "tests/fuzz/scene_data.h"

using namespace lumicut;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const fuzz::Folder folder;
  if (size == 0) return 0;
  constexpr const char* kNames[] = {"a.ply", "a.dae", "a.fbx"};
  try {
    fuzz::check_scene(io::read_model(folder.write(kNames[data[0] % 3], fuzz::text_of(data + 1, size - 1))));
  } catch (const io::FileError&) {
  }
  return 0;
}
