#include "scene/patterns.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace lumicut {

namespace {
constexpr float kPi = std::numbers::pi_v<float>;

// Off the borders of cells, where rounding would decide.
Vec3f off_borders(const Vec3f& p) { return (p + Vec3f{1e-6f, 1e-6f, 1e-6f}) * 0.999999f; }

float ease(float t) { return t * t * (3.0f - 2.0f * t); }

// 0 where there is no such integer.
int whole(float x) { return std::abs(x) < 1e9f ? static_cast<int>(x) : 0; }

// A random number in [0, 1) of an integer. [the integer noise of many shading languages' brick examples]
float random_of(uint32_t n) {
  n = (n + 1013u) & 0x7fffffffu;
  n ^= n >> 13;
  const uint32_t m = (n * (n * n * 60493u + 19990303u) + 1376312589u) & 0x7fffffffu;
  return 0.5f * (static_cast<float>(m) / 1073741824.0f);
}
}  // namespace

float checker(const Vec3f& at) {
  const Vec3f p = off_borders(at);
  const auto odd = [](float x) { return (whole(std::floor(x)) & 1) != 0; };
  return (odd(p.x) == odd(p.y)) == odd(p.z) ? 1.0f : 0.0f;
}

float gradient(const Vec3f& p, GradientKind kind) {
  const auto share = [](float x) { return std::clamp(x, 0.0f, 1.0f); };
  switch (kind) {
    case GradientKind::linear:
      return share(p.x);
    case GradientKind::quadratic:
      return share(std::max(p.x, 0.0f) * std::max(p.x, 0.0f));
    case GradientKind::easing:
      return ease(share(p.x));
    case GradientKind::diagonal:
      return share(0.5f * (p.x + p.y));
    case GradientKind::radial:
      return share(std::atan2(p.y, p.x) / (2.0f * kPi) + 0.5f);
    default: {
      const float inside = std::max(0.999999f - length(p), 0.0f);
      return share(kind == GradientKind::spherical ? inside : inside * inside);
    }
  }
}

Rgb magic(const Vec3f& at, int depth, float d) {
  const auto wrapped = [](float x) { return std::fmod(x, 2.0f * kPi); };
  const Vec3f p{wrapped(at.x), wrapped(at.y), wrapped(at.z)};
  float x = std::sin((p.x + p.y + p.z) * 5.0f), y = std::cos((-p.x + p.y - p.z) * 5.0f),
        z = -std::cos((-p.x - p.y + p.z) * 5.0f);
  if (depth > 0) {
    x *= d, y *= d, z *= d;
    y = -std::cos(x - y + z) * d;
  }
  if (depth > 1) x = std::cos(x - y - z) * d;
  if (depth > 2) z = std::sin(-x - y - z) * d;
  if (depth > 3) x = -std::cos(-x + y - z) * d;
  if (depth > 4) y = -std::sin(-x + y + z) * d;
  if (depth > 5) y = -std::cos(-x + y + z) * d;
  if (depth > 6) x = std::cos(x + y + z) * d;
  if (depth > 7) z = std::sin(x + y - z) * d;
  if (depth > 8) x = -std::cos(-x - y + z) * d;
  if (depth > 9) y = -std::sin(x - y + z) * d;
  if (d != 0.0f) x /= 2.0f * d, y /= 2.0f * d, z /= 2.0f * d;
  return {0.5f - x, 0.5f - y, 0.5f - z};
}

float wave(const Vec3f& at, const WaveOptions& o) {
  const Vec3f p = off_borders(at);
  float n = 0.0f;
  if (o.rings) {
    Vec3f r = p;
    if (o.direction != WaveDirection::diagonal) r[static_cast<int>(o.direction)] = 0.0f;
    n = 20.0f * length(r);
  } else {
    n = o.direction == WaveDirection::diagonal ? 10.0f * (p.x + p.y + p.z) : 20.0f * p[static_cast<int>(o.direction)];
  }
  n += o.phase;
  if (o.distortion != 0.0f) {
    NoiseOptions noise;
    noise.detail = o.detail, noise.roughness = std::clamp(o.detail_roughness, 0.0f, 1.0f);
    const Vec3f q = p * o.detail_scale;
    n += o.distortion * (2.0f * fractal_noise({q.x, q.y, q.z}, NoiseKind::fbm, noise) - 1.0f);
  }
  if (o.profile == WaveProfile::sine) return 0.5f + 0.5f * std::sin(n - 0.5f * kPi);
  n /= 2.0f * kPi;
  return o.profile == WaveProfile::saw ? n - std::floor(n) : 2.0f * std::abs(n - std::floor(n + 0.5f));
}

Brick brick(const Vec3f& p, const BrickOptions& o) {
  float width = o.width, offset = 0.0f;
  const int row = whole(std::floor(p.y / o.height));
  if (o.offset_frequency != 0 && o.squash_frequency != 0) {
    if (row % o.squash_frequency == 0) width *= o.squash;
    if (row % o.offset_frequency == 0) offset = width * o.offset;
  }
  const int column = whole(std::floor((p.x + offset) / width));
  const float x = p.x + offset - width * static_cast<float>(column), y = p.y - o.height * static_cast<float>(row);
  const uint32_t number = (static_cast<uint32_t>(row) << 16) + (static_cast<uint32_t>(column) & 0xffffu);
  Brick out;
  out.tint = std::clamp(random_of(number) + o.bias, 0.0f, 1.0f);
  const float inside = std::min(std::min(x, y), std::min(width - x, o.height - y));
  if (inside >= o.mortar_size) {
    out.mortar = 0.0f;
  } else if (o.mortar_smooth == 0.0f) {
    out.mortar = 1.0f;
  } else {
    const float depth = 1.0f - inside / o.mortar_size;
    out.mortar = depth < o.mortar_smooth ? ease(depth / o.mortar_smooth) : 1.0f;
  }
  return out;
}

}  // namespace lumicut
