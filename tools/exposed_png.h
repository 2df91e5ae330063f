// The PNG beside an EXR: exposed, cut to [0,1], sRGB.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "film/metrics.h"
#include "io/image_file.h"
#include "tools/render_setup.h"

namespace lumicut::tools {

// --png and --exposure.
inline void add_png_options(CLI::App& command, std::string& png, float& exposure) {
  command.add_option("--png", png, "PNG to write too: exposed, cut to [0,1], sRGB")->check(picture_of({".png"}));
  command
      .add_option("--exposure", exposure, "Factor from radiance to [0,1] for the PNG (default: 0.18 / geometric mean)")
      ->check(number_in(0, 1e30));
}

// `exposure` 0: auto_exposure.
inline void write_exposed_png(const std::string& path, const RgbImage& image, float exposure) {
  io::write_png(path, to_srgb8(image, exposure > 0 ? exposure : auto_exposure(image)), static_cast<int>(image.width),
                static_cast<int>(image.height), 3);
}

}  // namespace lumicut::tools
