// Scenes in text, beside a file to include, a mesh and a picture.
#pragma once

#include <string>

#include "io/file_error.h"
#include "tests/fuzz/fuzz.h"
#include "tests/fuzz/libpng_leak.h"
#include "tests/fuzz/scene_data.h"

namespace lumicut::fuzz {

// `read` takes the path of a.EXTENSION; b.EXTENSION holds `included`.
template <typename Read>
void read_scene_text(const uint8_t* data, size_t size, const std::string& extension, const char* included, Read read) {
  static const Folder folder;
  [[maybe_unused]] static const bool once = [&] {
    folder.write("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    folder.write("b." + extension, included);
    folder.write("a.pgm", "P2 2 2 255 0 9 99 255\n");
    return true;
  }();
  try {
    check_scene(read(folder.write("a." + extension, text_of(data, size))));
  } catch (const io::FileError&) {
  }
}

}  // namespace lumicut::fuzz
