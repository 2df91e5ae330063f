#include "scene/noise.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

namespace lumicut {

namespace {

// The last step of lookup3, and the one for what goes before.
void finish(uint32_t& a, uint32_t& b, uint32_t& c) {
  const auto step = [](uint32_t& to, uint32_t from, int turn) { to = (to ^ from) - std::rotl(from, turn); };
  step(c, b, 14), step(a, c, 11), step(b, a, 25), step(c, b, 16), step(a, c, 4), step(b, a, 14), step(c, b, 24);
}
void stir(uint32_t& a, uint32_t& b, uint32_t& c) {
  const auto step = [](uint32_t& to, uint32_t from, int turn, uint32_t other) {
    to -= from, to ^= std::rotl(from, turn), from += other;
    return from;
  };
  c = step(a, c, 4, b), a = step(b, a, 6, c), b = step(c, b, 8, a);
  c = step(a, c, 16, b), a = step(b, a, 19, c), b = step(c, b, 4, a);
}
constexpr uint32_t start(uint32_t words) { return 0xdeadbeefu + (words << 2) + 13u; }

uint32_t bits(float x) { return std::bit_cast<uint32_t>(x); }
float unit(uint32_t h) { return static_cast<float>(h) / static_cast<float>(0xffffffffu); }

float smooth(float t) { return t * t * t * (t * (t * 6.0f - 15.0f) + 10.0f); }
float signed_by(float x, uint32_t minus) { return minus != 0 ? -x : x; }

// Slopes along the lattice's gradients, which its hashes choose.
float slope(uint32_t hash, float x) { return signed_by(1.0f + static_cast<float>(hash & 7u), hash & 8u) * x; }
float slope(uint32_t hash, float x, float y) {
  const bool first = (hash & 7u) < 4u;
  return signed_by(first ? x : y, hash & 1u) + signed_by(2.0f * (first ? y : x), hash & 2u);
}
float slope(uint32_t hash, float x, float y, float z) {
  const uint32_t h = hash & 15u;
  return signed_by(h < 8u ? x : y, h & 1u) + signed_by(h < 4u ? y : (h == 12u || h == 14u ? x : z), h & 2u);
}
float slope(uint32_t hash, float x, float y, float z, float w) {
  const uint32_t h = hash & 31u;
  return signed_by(h < 24u ? x : y, h & 1u) + signed_by(h < 16u ? y : z, h & 2u) + signed_by(h < 8u ? z : w, h & 4u);
}

// A lattice cell and the place in it.
struct Cell {
  uint32_t i;
  float f, s;
  explicit Cell(float x) {
    constexpr float kMost = 1073741824.0f;  // beyond, coordinates have no fraction
    const float low = std::floor(x);
    i = static_cast<uint32_t>(std::abs(low) < kMost ? static_cast<int32_t>(low) : 0);
    f = x - low, s = smooth(f);
  }
};
float mixed(float a, float b, float t) { return a + (b - a) * t; }

float perlin(float px) {
  const Cell x(px);
  return mixed(slope(hash_words(x.i), x.f), slope(hash_words(x.i + 1), x.f - 1), x.s);
}
float perlin(float px, float py) {
  const Cell x(px), y(py);
  const auto row = [&](uint32_t j, float fy) {
    return mixed(slope(hash_words(x.i, j), x.f, fy), slope(hash_words(x.i + 1, j), x.f - 1, fy), x.s);
  };
  return mixed(row(y.i, y.f), row(y.i + 1, y.f - 1), y.s);
}
float perlin(float px, float py, float pz) {
  const Cell x(px), y(py), z(pz);
  const auto row = [&](uint32_t j, uint32_t k, float fy, float fz) {
    return mixed(slope(hash_words(x.i, j, k), x.f, fy, fz), slope(hash_words(x.i + 1, j, k), x.f - 1, fy, fz), x.s);
  };
  const auto sheet = [&](uint32_t k, float fz) {
    return mixed(row(y.i, k, y.f, fz), row(y.i + 1, k, y.f - 1, fz), y.s);
  };
  return mixed(sheet(z.i, z.f), sheet(z.i + 1, z.f - 1), z.s);
}
float perlin(float px, float py, float pz, float pw) {
  const Cell x(px), y(py), z(pz), w(pw);
  const auto row = [&](uint32_t j, uint32_t k, uint32_t l, float fy, float fz, float fw) {
    return mixed(slope(hash_words(x.i, j, k, l), x.f, fy, fz, fw),
                 slope(hash_words(x.i + 1, j, k, l), x.f - 1, fy, fz, fw), x.s);
  };
  const auto sheet = [&](uint32_t k, uint32_t l, float fz, float fw) {
    return mixed(row(y.i, k, l, y.f, fz, fw), row(y.i + 1, k, l, y.f - 1, fz, fw), y.s);
  };
  const auto block = [&](uint32_t l, float fw) {
    return mixed(sheet(z.i, l, z.f, fw), sheet(z.i + 1, l, z.f - 1, fw), z.s);
  };
  return mixed(block(w.i, w.f), block(w.i + 1, w.f - 1), w.s);
}

Vec4f scaled(const Vec4f& p, float s) { return {p.x * s, p.y * s, p.z * s, p.w * s}; }
Vec4f moved(const Vec4f& p, const Vec4f& by) { return {p.x + by.x, p.y + by.y, p.z + by.z, p.w + by.w}; }

constexpr float kMostOctaves = 15.0f;
float octaves_of(float detail) { return detail > 0.0f ? std::min(detail, kMostOctaves) : 0.0f; }

// Far from the origin by a distance that the seed, a small number, chooses in each dimension.
const Vec4f& far_away(int seed, int dimensions) {
  constexpr int kSeeds = 6;
  static const auto table = [] {
    std::array<std::array<Vec4f, kSeeds>, 2> t;
    const auto at = [](float h) { return 100.0f + 100.0f * h; };
    for (int k = 0; k < kSeeds; ++k) {
      const auto s = static_cast<float>(k);
      t[0][k] = {at(hash_unit(s)), 0, 0, 0};
      t[1][k] = {at(hash_unit(s, 0.0f)), at(hash_unit(s, 1.0f)), at(hash_unit(s, 2.0f)), at(hash_unit(s, 3.0f))};
    }
    return t;
  }();
  return table[dimensions == 1 ? 0 : 1][seed];
}

// The seeds of the displacement are 0 to dimensions - 1, those of colours follow.
Vec4f displaced(const Vec4f& p, float distortion, int dimensions) {
  if (distortion == 0.0f) return p;
  const auto along = [&](int k) {
    return k < dimensions ? distortion * signed_noise(moved(p, far_away(k, dimensions)), dimensions) : 0.0f;
  };
  return moved(p, {along(0), along(1), along(2), along(3)});
}

float finite(float x) { return std::isfinite(x) ? x : 0.0f; }

}  // namespace

uint32_t hash_words(uint32_t x) {
  uint32_t a = start(1), b = a, c = a;
  a += x;
  finish(a, b, c);
  return c;
}
uint32_t hash_words(uint32_t x, uint32_t y) {
  uint32_t a = start(2), b = a, c = a;
  b += y, a += x;
  finish(a, b, c);
  return c;
}
uint32_t hash_words(uint32_t x, uint32_t y, uint32_t z) {
  uint32_t a = start(3), b = a, c = a;
  c += z, b += y, a += x;
  finish(a, b, c);
  return c;
}
uint32_t hash_words(uint32_t x, uint32_t y, uint32_t z, uint32_t w) {
  uint32_t a = start(4), b = a, c = a;
  a += x, b += y, c += z;
  stir(a, b, c);
  a += w;
  finish(a, b, c);
  return c;
}

float hash_unit(float x) { return unit(hash_words(bits(x))); }
float hash_unit(float x, float y) { return unit(hash_words(bits(x), bits(y))); }
float hash_unit(float x, float y, float z) { return unit(hash_words(bits(x), bits(y), bits(z))); }
float hash_unit(float x, float y, float z, float w) { return unit(hash_words(bits(x), bits(y), bits(z), bits(w))); }

Rgb hash_color(const Vec4f& p, int dimensions) {
  switch (dimensions) {
    case 1:
      return {hash_unit(p.x), hash_unit(p.x, 1.0f), hash_unit(p.x, 2.0f)};
    case 2:
      return {hash_unit(p.x, p.y), hash_unit(p.x, p.y, 1.0f), hash_unit(p.x, p.y, 2.0f)};
    case 3:
      return {hash_unit(p.x, p.y, p.z), hash_unit(p.x, p.y, p.z, 1.0f), hash_unit(p.x, p.y, p.z, 2.0f)};
    default:
      return {hash_unit(p.x, p.y, p.z, p.w), hash_unit(p.z, p.x, p.w, p.y), hash_unit(p.w, p.z, p.y, p.x)};
  }
}

Vec4f hash_place(const Vec4f& p, int dimensions) {
  switch (dimensions) {
    case 1:
      return {hash_unit(p.x)};
    case 2:
      return {hash_unit(p.x, p.y), hash_unit(p.x, p.y, 1.0f)};
    case 3: {
      const Rgb h = hash_color(p, 3);
      return {h.x, h.y, h.z};
    }
    default:
      return {hash_unit(p.x, p.y, p.z, p.w), hash_unit(p.w, p.x, p.y, p.z), hash_unit(p.z, p.w, p.x, p.y),
              hash_unit(p.y, p.z, p.w, p.x)};
  }
}

// The factors bring each dimension's noise to about the same range.
float signed_noise(const Vec4f& p, int dimensions) {
  switch (dimensions) {
    case 1:
      return finite(0.25f * perlin(p.x));
    case 2:
      return finite(0.6616f * perlin(p.x, p.y));
    case 3:
      return finite(0.982f * perlin(p.x, p.y, p.z));
    default:
      return finite(0.8344f * perlin(p.x, p.y, p.z, p.w));
  }
}

float fractal_noise(const Vec4f& p, NoiseKind kind, const NoiseOptions& o) {
  const float octaves = octaves_of(o.detail), rest = octaves - std::floor(octaves);
  const int whole = static_cast<int>(octaves);
  float frequency = 1.0f;
  const auto noise = [&] { return signed_noise(scaled(p, frequency), o.dimensions); };
  if (kind == NoiseKind::fbm) {
    float amplitude = 1.0f, largest = 0.0f, sum = 0.0f;
    for (int i = 0; i <= whole; ++i) {
      sum += amplitude * noise(), largest += amplitude;
      amplitude *= o.roughness, frequency *= o.lacunarity;
    }
    const auto ranged = [&](float s, float of) { return o.normalize ? 0.5f * s / of + 0.5f : s; };
    if (rest == 0.0f) return ranged(sum, largest);
    const float more = sum + amplitude * noise();
    return mixed(ranged(sum, largest), ranged(more, largest + amplitude), rest);
  }
  if (kind == NoiseKind::multifractal) {
    float value = 1.0f, power = 1.0f;
    for (int i = 0; i <= whole; ++i) value *= power * noise() + 1.0f, power *= o.roughness, frequency *= o.lacunarity;
    return rest == 0.0f ? value : value * (rest * power * noise() + 1.0f);
  }
  if (kind == NoiseKind::hetero) {
    float power = o.roughness, value = o.offset + noise();
    frequency *= o.lacunarity;
    for (int i = 1; i <= whole; ++i) {
      value += (noise() + o.offset) * power * value;
      power *= o.roughness, frequency *= o.lacunarity;
    }
    return rest == 0.0f ? value : value + rest * (noise() + o.offset) * power * value;
  }
  if (kind == NoiseKind::hybrid) {
    float power = 1.0f, value = 0.0f, weight = 1.0f;
    for (int i = 0; weight > 0.001f && i <= whole; ++i) {
      weight = std::min(weight, 1.0f);
      const float signal = (noise() + o.offset) * power;
      power *= o.roughness, value += weight * signal, weight *= o.gain * signal, frequency *= o.lacunarity;
    }
    if (rest == 0.0f || !(weight > 0.001f)) return value;
    return value + rest * std::min(weight, 1.0f) * ((noise() + o.offset) * power);
  }
  // Ridged.
  float power = o.roughness, signal = o.offset - std::abs(noise());
  signal *= signal;
  float value = signal;
  for (int i = 1; i <= whole; ++i) {
    frequency *= o.lacunarity;
    const float weight = std::clamp(signal * o.gain, 0.0f, 1.0f);
    signal = o.offset - std::abs(noise());
    signal *= signal * weight;
    value += signal * power, power *= o.roughness;
  }
  return value;
}

float musgrave_noise(const Vec4f& p, NoiseKind kind, const NoiseOptions& o) {
  const float octaves = octaves_of(o.detail), rest = octaves - std::floor(octaves);
  const int whole = static_cast<int>(octaves);
  float frequency = 1.0f, power = 1.0f;
  const auto noise = [&] { return signed_noise(scaled(p, frequency), o.dimensions); };
  const auto next = [&] { power *= o.roughness, frequency *= o.lacunarity; };
  switch (kind) {
    case NoiseKind::fbm: {
      float value = 0.0f;
      for (int i = 0; i < whole; ++i, next()) value += noise() * power;
      return rest == 0.0f ? value : value + rest * noise() * power;
    }
    case NoiseKind::multifractal: {
      float value = 1.0f;
      for (int i = 0; i < whole; ++i, next()) value *= power * noise() + 1.0f;
      return rest == 0.0f ? value : value * (rest * power * noise() + 1.0f);
    }
    case NoiseKind::hetero: {
      float value = o.offset + noise();
      next();
      for (int i = 1; i < whole; ++i, next()) value += (noise() + o.offset) * power * value;
      return rest == 0.0f ? value : value + rest * (noise() + o.offset) * power * value;
    }
    case NoiseKind::hybrid: {
      float value = noise() + o.offset, weight = o.gain * value;
      next();
      for (int i = 1; weight > 0.001f && i < whole; ++i, next()) {
        weight = std::min(weight, 1.0f);
        const float signal = (noise() + o.offset) * power;
        value += weight * signal, weight *= o.gain * signal;
      }
      if (rest == 0.0f || !(weight > 0.001f)) return value;
      return value + rest * std::min(weight, 1.0f) * ((noise() + o.offset) * power);
    }
    default: {
      float signal = o.offset - std::abs(noise());
      signal *= signal;
      float value = signal;
      next();
      for (int i = 1; i < whole; ++i, next()) {
        const float weight = std::clamp(signal * o.gain, 0.0f, 1.0f);
        signal = o.offset - std::abs(noise());
        signal *= signal * weight;
        value += signal * power;
      }
      return value;
    }
  }
}

float noise_texture(Vec4f p, float distortion, NoiseKind kind, const NoiseOptions& o) {
  return fractal_noise(displaced(p, distortion, o.dimensions), kind, o);
}

Rgb noise_texture_color(Vec4f p, float distortion, NoiseKind kind, const NoiseOptions& o) {
  p = displaced(p, distortion, o.dimensions);
  const auto other = [&](int k) { return fractal_noise(moved(p, far_away(o.dimensions + k, o.dimensions)), kind, o); };
  return {fractal_noise(p, kind, o), other(0), other(1)};
}

}  // namespace lumicut
