// The PNG beside an EXR: exposed, cut to [0,1], sRGB.
#pragma once

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

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

// `exposure` 0: auto_exposure. `alpha`: by which the image is multiplied, as PNG files do not have it; or empty.
inline void write_exposed_png(const std::string& path, const RgbImage& image, float exposure,
                              const std::vector<float>& alpha = {}) {
  const float factor = exposure > 0 ? exposure : auto_exposure(image);
  const int width = static_cast<int>(image.width), height = static_cast<int>(image.height);
  if (alpha.empty()) return io::write_png(path, to_srgb8(image, factor), width, height, 3);
  std::vector<float> apart(image.pixels.begin(), image.pixels.end());
  for (size_t i = 0; i < apart.size(); ++i)
    if (alpha[i / 3] > 0) apart[i] /= alpha[i / 3];
  const std::vector<uint8_t> color = to_srgb8({apart, image.width, image.height}, factor);
  std::vector<uint8_t> pixels;
  for (size_t i = 0; i < alpha.size(); ++i) {
    pixels.insert(pixels.end(), {color[3 * i], color[3 * i + 1], color[3 * i + 2]});
    pixels.push_back(static_cast<uint8_t>(std::lround(255 * std::clamp(alpha[i], 0.0f, 1.0f))));
  }
  io::write_png(path, pixels, width, height, 4);
}

}  // namespace lumicut::tools
