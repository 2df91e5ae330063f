// Hashes and gradient noise of one to four dimensions, as shading languages have them: Jenkins' lookup3 over the bits of
// coordinates, Perlin's improved noise on its lattice, and sums of octaves of it.
// [Jenkins 2006, lookup3.c; Perlin 2002, "Improving Noise"; Musgrave in Ebert et al. 2003, "Texturing and Modeling"]
#pragma once

#include <cstdint>

#include "core/vec.h"

namespace lumicut {

// A place in up to four dimensions; those beyond count for nothing.
struct Vec4f {
  float x{}, y{}, z{}, w{};
};

uint32_t hash_words(uint32_t x);
uint32_t hash_words(uint32_t x, uint32_t y);
uint32_t hash_words(uint32_t x, uint32_t y, uint32_t z);
uint32_t hash_words(uint32_t x, uint32_t y, uint32_t z, uint32_t w);

// Even in [0, 1], of the bits of floats: 0 and -0 differ.
float hash_unit(float x);
float hash_unit(float x, float y);
float hash_unit(float x, float y, float z);
float hash_unit(float x, float y, float z, float w);

// Three independent ones of the first `dimensions` coordinates.
Rgb hash_color(const Vec4f& p, int dimensions);
// As many as there are dimensions.
Vec4f hash_place(const Vec4f& p, int dimensions);

// Within about [-1, 1], 0 on the lattice. `dimensions` in 1..4.
float signed_noise(const Vec4f& p, int dimensions);

enum class NoiseKind : uint8_t { fbm, multifractal, hybrid, ridged, hetero };

struct NoiseOptions {
  int dimensions = 3;
  float detail = 0.0f;      // octaves beyond the first, with a fraction; 0..15
  float roughness = 0.5f;   // amplitude of each octave over that of the one before
  float lacunarity = 2.0f;  // frequency of each over that of the one before
  float offset = 0.0f, gain = 1.0f;
  bool normalize = true;  // fbm alone: from 0 to 1
};

// Sums of octaves: int(detail) + 1, and the share of one more. `kind`: in fbm they add, in the others they multiply or
// weight one another.
float fractal_noise(const Vec4f& p, NoiseKind kind, const NoiseOptions& options);

// Musgrave's own five, which have int(detail) octaves and the share of one more. `roughness` holds
// lacunarity^-dimension.
float musgrave_noise(const Vec4f& p, NoiseKind kind, const NoiseOptions& options);

// Displaces the place by noise, as far as `distortion`, then the noise there: a number.
float noise_texture(Vec4f p, float distortion, NoiseKind kind, const NoiseOptions& options);
// The same with two more that are independent.
Rgb noise_texture_color(Vec4f p, float distortion, NoiseKind kind, const NoiseOptions& options);

}  // namespace lumicut
