// Images on surfaces and around the scene. Texels are kept as the host gave them (bytes stay bytes).
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/fields.h"
#include "core/vec.h"
#include "scene/texture_program.h"

namespace lumicut {

class Texture {
 public:
  enum class Format { uint8, float32 };
  struct Options {
    bool srgb = false;     // decode colour channels (never alpha) from sRGB
    bool clamp = false;    // else repeat
    bool nearest = false;  // else bilinear
    // Looked up by the view instead of by uv: see by_view(). An even width.
    bool by_view = false;
    bool blend_stored = false;  // with srgb: what is stored is blended, and decoded then
    LUMICUT_FIELDS(Options, srgb, clamp, nearest, by_view, blend_stored)
  };

  // `pixels`: height rows of width texels of `channels` (1..4) values, packed, row 0 on top (v = 1). Copied.
  // Throws Error naming the bad value.
  Texture(uint32_t width, uint32_t height, uint32_t channels, Format format, Options options, const void* pixels);
  // A program in an image's place; nothing of what follows is for it.
  explicit Texture(TextureProgram program);

  // nullptr: an image.
  const TextureProgram* program() const { return program_.get(); }

  // Linear colour at (u, v), v upwards; one channel is grey, two are grey and alpha. Never NaN.
  Rgb color(float u, float v) const;
  // Where the texture of a surface is looked up that is seen at `cosine` to its normal. Its right half is for the front,
  // from edge-on to straight on between the centres of its first and last texels; its left half likewise, mirrored, for
  // the back.
  bool is_by_view() const { return options_.by_view; }
  Rgb by_view(float cosine, bool behind) const;
  // The opacity mask's value: the only channel, the alpha of two or four, the mean of three.
  float mask(float u, float v) const;

  uint32_t width() const { return width_; }
  uint32_t height() const { return height_; }
  bool clamped() const { return options_.clamp; }
  bool nearest() const { return options_.nearest; }
  // Linear colour of one texel, row 0 on top.
  Rgb texel(uint32_t x, uint32_t y) const;
  // Mean linear colour.
  Rgb average() const;
  bool has_alpha() const { return channels_ == 2 || channels_ == 4; }

 private:
  float value(uint32_t x, uint32_t y, uint32_t channel) const;
  float stored(size_t i) const;
  template <typename Fetch>
  auto filter(float u, float v, Fetch fetch) const;

  uint32_t width_, height_, channels_;
  Format format_;
  Options options_;
  std::vector<uint8_t> bytes_;
  std::vector<float> floats_;
  std::shared_ptr<const TextureProgram> program_;
  LUMICUT_FIELDS(Texture, width_, height_, channels_, format_, options_, bytes_, floats_, program_)
};

}  // namespace lumicut
