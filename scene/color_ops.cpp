#include "scene/color_ops.h"

#include <algorithm>
#include <cmath>

namespace lumicut {

namespace {

float min_component(const Rgb& c) { return std::min(c.x, std::min(c.y, c.z)); }

// Sixth of the circle that the colour lies in, by its largest channel.
float hue_of(const Rgb& c, float high, float range) {
  if (!(range > 0.0f)) return 0.0f;
  float h = 0.0f;
  if (c.x == high)
    h = (c.y - c.z) / range;
  else if (c.y == high)
    h = 2.0f + (c.z - c.x) / range;
  else
    h = 4.0f + (c.x - c.y) / range;
  h /= 6.0f;
  return h < 0.0f ? h + 1.0f : h;
}

// A hue at full saturation: each channel is 1 over a third of the circle and falls off to its sides.
Rgb pure(float hue) {
  const auto channel = [](float x) { return std::clamp(x, 0.0f, 1.0f); };
  return {channel(std::abs(hue * 6.0f - 3.0f) - 1.0f), channel(2.0f - std::abs(hue * 6.0f - 2.0f)),
          channel(2.0f - std::abs(hue * 6.0f - 4.0f))};
}

template <typename Fn>
Rgb by_channel(const Rgb& a, const Rgb& b, const Fn& fn) {
  return {fn(a.x, b.x), fn(a.y, b.y), fn(a.z, b.z)};
}

Rgb mixed(const Rgb& a, const Rgb& b, float t) { return a * (1.0f - t) + b * t; }

constexpr Rgb kWhite{1, 1, 1};

}  // namespace

Vec3f hsv_of(const Rgb& c) {
  const float high = max_component(c), range = high - min_component(c);
  const float saturation = high != 0.0f ? range / high : 0.0f;
  return {saturation != 0.0f ? hue_of(c, high, range) : 0.0f, saturation, high};
}

Rgb of_hsv(const Vec3f& hsv) {
  if (hsv.y == 0.0f) return {hsv.z, hsv.z, hsv.z};
  const float h = hsv.x - std::floor(hsv.x);
  return (mixed(kWhite, pure(h), hsv.y)) * hsv.z;
}

Vec3f hsl_of(const Rgb& c) {
  const float high = max_component(c), low = min_component(c), range = high - low;
  const float lightness = std::min(1.0f, 0.5f * (high + low));
  if (!(range > 0.0f)) return {0.0f, 0.0f, lightness};
  return {hue_of(c, high, range), lightness > 0.5f ? range / (2.0f - high - low) : range / (high + low), lightness};
}

Rgb of_hsl(const Vec3f& hsl) {
  const float chroma = (1.0f - std::abs(2.0f * hsl.z - 1.0f)) * hsl.y;
  return (pure(hsl.x) - kWhite * 0.5f) * chroma + kWhite * hsl.z;
}

Rgb blend(BlendMode mode, float t, const Rgb& a, const Rgb& b) {
  const float rest = 1.0f - t;
  switch (mode) {
    case BlendMode::mix:
      return mixed(a, b, t);
    case BlendMode::darken:
      return mixed(a, min(a, b), t);
    case BlendMode::multiply:
      return mixed(a, a * b, t);
    case BlendMode::burn:
      return by_channel(a, b, [&](float x, float y) {
        const float under = rest + t * y;
        return under <= 0.0f ? 0.0f : std::clamp(1.0f - (1.0f - x) / under, 0.0f, 1.0f);
      });
    case BlendMode::lighten:
      return mixed(a, max(a, b), t);
    case BlendMode::screen:
      return kWhite - (kWhite * rest + (kWhite - b) * t) * (kWhite - a);
    case BlendMode::dodge:
      return by_channel(a, b, [&](float x, float y) {
        if (x == 0.0f) return 0.0f;
        const float under = 1.0f - t * y;
        return under <= 0.0f ? 1.0f : std::min(1.0f, x / under);
      });
    case BlendMode::add:
      return mixed(a, a + b, t);
    case BlendMode::overlay:
      return by_channel(a, b, [&](float x, float y) {
        return x < 0.5f ? x * (rest + 2.0f * t * y) : 1.0f - (rest + 2.0f * t * (1.0f - y)) * (1.0f - x);
      });
    case BlendMode::soft_light:
      return a * rest + ((kWhite - a) * b * a + a * (kWhite - (kWhite - b) * (kWhite - a))) * t;
    case BlendMode::linear_light:
      return a + (b * 2.0f - kWhite) * t;
    case BlendMode::difference:
      return mixed(a, max(a - b, b - a), t);
    case BlendMode::exclusion:
      return max(mixed(a, a + b - a * b * 2.0f, t), Rgb{});
    case BlendMode::subtract:
      return mixed(a, a - b, t);
    case BlendMode::divide:
      return by_channel(a, b, [&](float x, float y) { return y != 0.0f ? rest * x + t * x / y : x; });
    case BlendMode::hue:
    case BlendMode::color: {
      const Vec3f of = hsv_of(b);
      if (of.y == 0.0f) return a;
      Vec3f hsv = hsv_of(a);
      hsv.x = of.x;
      if (mode == BlendMode::color) hsv.y = of.y;
      return mixed(a, of_hsv(hsv), t);
    }
    case BlendMode::saturation: {
      Vec3f hsv = hsv_of(a);
      if (hsv.y == 0.0f) return a;
      hsv.y = rest * hsv.y + t * hsv_of(b).y;
      return of_hsv(hsv);
    }
    case BlendMode::value: {
      Vec3f hsv = hsv_of(a);
      hsv.z = rest * hsv.z + t * hsv_of(b).z;
      return of_hsv(hsv);
    }
  }
  return a;
}

}  // namespace lumicut
