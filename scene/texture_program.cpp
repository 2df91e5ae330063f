#include "scene/texture_program.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "core/current_work.h"
#include "core/error.h"
#include "core/number_text.h"
#include "scene/camera.h"
#include "scene/color_ops.h"
#include "scene/mesh.h"
#include "scene/noise.h"
#include "scene/patterns.h"
#include "scene/texture.h"
#include "scene/voronoi.h"

namespace lumicut {

namespace {

constexpr float kPi = std::numbers::pi_v<float>;

constexpr ProgramOpInfo kOps[] = {
#define LUMICUT_OP(name, inputs, modes, data) {#name, inputs, modes, ProgramData::data},
    LUMICUT_PROGRAM_OPS(LUMICUT_OP)
#undef LUMICUT_OP
};

Vec3f all(float x) { return {x, x, x}; }

template <typename Fn>
Vec3f each(const Vec3f& a, const Fn& fn) {
  return {fn(a.x), fn(a.y), fn(a.z)};
}
template <typename Fn>
Vec3f each(const Vec3f& a, const Vec3f& b, const Fn& fn) {
  return {fn(a.x, b.x), fn(a.y, b.y), fn(a.z, b.z)};
}
template <typename Fn>
Vec3f each(const Vec3f& a, const Vec3f& b, const Vec3f& c, const Fn& fn) {
  return {fn(a.x, b.x, c.x), fn(a.y, b.y, c.y), fn(a.z, b.z, c.z)};
}

float divided(float a, float b) { return b != 0.0f ? a / b : 0.0f; }
float modulo(float a, float b) { return b != 0.0f ? std::fmod(a, b) : 0.0f; }
float fraction(float a) { return a - std::floor(a); }
float wrapped(float x, float high, float low) {
  const float range = high - low;
  return range != 0.0f ? x - range * std::floor((x - low) / range) : low;
}
float snapped(float a, float b) { return std::floor(divided(a, b)) * b; }
float power(float a, float b) { return a < 0.0f && b != std::floor(b) ? 0.0f : std::pow(a, b); }
float smooth_least(float a, float b, float reach) {
  if (reach == 0.0f) return std::min(a, b);
  const float h = std::max(reach - std::abs(a - b), 0.0f) / reach;
  return std::min(a, b) - h * h * h * reach * (1.0f / 6.0f);
}

// Modes of LUMICUT_OP_MATH, in their order.
enum class MathMode : uint32_t {
  add,
  subtract,
  multiply,
  divide,
  multiply_add,
  power,
  logarithm,
  sqrt,
  inverse_sqrt,
  absolute,
  exponent,
  minimum,
  maximum,
  less_than,
  greater_than,
  sign,
  compare,
  smooth_min,
  smooth_max,
  round,
  floor,
  ceil,
  trunc,
  fract,
  modulo,
  floored_modulo,
  wrap,
  snap,
  pingpong,
  sine,
  cosine,
  tangent,
  arcsine,
  arccosine,
  arctangent,
  arctan2,
  sinh,
  cosh,
  tanh,
  radians,
  degrees,
};

float math(MathMode mode, float a, float b, float c) {
  using M = MathMode;
  switch (mode) {
    case M::add:
      return a + b;
    case M::subtract:
      return a - b;
    case M::multiply:
      return a * b;
    case M::divide:
      return divided(a, b);
    case M::multiply_add:
      return a * b + c;
    case M::power:
      return power(a, b);
    case M::logarithm:
      return a > 0.0f && b > 0.0f ? divided(std::log(a), std::log(b)) : 0.0f;
    case M::sqrt:
      return std::sqrt(std::max(a, 0.0f));
    case M::inverse_sqrt:
      return a > 0.0f ? 1.0f / std::sqrt(a) : 0.0f;
    case M::absolute:
      return std::abs(a);
    case M::exponent:
      return std::exp(a);
    case M::minimum:
      return std::min(a, b);
    case M::maximum:
      return std::max(a, b);
    case M::less_than:
      return a < b ? 1.0f : 0.0f;
    case M::greater_than:
      return a > b ? 1.0f : 0.0f;
    case M::sign:
      return a > 0.0f ? 1.0f : (a < 0.0f ? -1.0f : 0.0f);
    case M::compare:
      return std::abs(a - b) <= std::max(c, 1e-5f) ? 1.0f : 0.0f;
    case M::smooth_min:
      return smooth_least(a, b, c);
    case M::smooth_max:
      return -smooth_least(-a, -b, c);
    case M::round:
      return std::floor(a + 0.5f);
    case M::floor:
      return std::floor(a);
    case M::ceil:
      return std::ceil(a);
    case M::trunc:
      return std::trunc(a);
    case M::fract:
      return fraction(a);
    case M::modulo:
      return modulo(a, b);
    case M::floored_modulo:
      return b != 0.0f ? a - std::floor(a / b) * b : 0.0f;
    case M::wrap:
      return wrapped(a, b, c);
    case M::snap:
      return snapped(a, b);
    case M::pingpong:
      return b != 0.0f ? std::abs(fraction((a - b) / (b * 2.0f)) * b * 2.0f - b) : 0.0f;
    case M::sine:
      return std::sin(a);
    case M::cosine:
      return std::cos(a);
    case M::tangent:
      return std::tan(a);
    case M::arcsine:
      return std::asin(std::clamp(a, -1.0f, 1.0f));
    case M::arccosine:
      return std::acos(std::clamp(a, -1.0f, 1.0f));
    case M::arctangent:
      return std::atan(a);
    case M::arctan2:
      return std::atan2(a, b);
    case M::sinh:
      return std::sinh(a);
    case M::cosh:
      return std::cosh(a);
    case M::tanh:
      return std::tanh(a);
    case M::radians:
      return a * (kPi / 180.0f);
    case M::degrees:
    default:
      return a * (180.0f / kPi);
  }
}

// Modes of LUMICUT_OP_VECTOR, in their order.
enum class VectorMode : uint32_t {
  add,
  subtract,
  multiply,
  divide,
  multiply_add,
  cross_product,
  project,
  reflect,
  refract,
  faceforward,
  dot_product,
  distance,
  length,
  scale,
  normalize,
  absolute,
  minimum,
  maximum,
  floor,
  ceil,
  fraction,
  modulo,
  wrap,
  snap,
  sine,
  cosine,
  tangent,
};

Vec3f vector_math(VectorMode mode, const Vec3f& a, const Vec3f& b, const Vec3f& c) {
  using M = VectorMode;
  switch (mode) {
    case M::add:
      return a + b;
    case M::subtract:
      return a - b;
    case M::multiply:
      return a * b;
    case M::divide:
      return each(a, b, divided);
    case M::multiply_add:
      return a * b + c;
    case M::cross_product:
      return cross(a, b);
    case M::project:
      return b * divided(dot(a, b), length2(b));
    case M::reflect: {
      const Vec3f n = normalize(b);
      return a - n * (2.0f * dot(a, n));
    }
    case M::refract: {
      const Vec3f n = normalize(b);
      const float cosine = dot(n, a), k = 1.0f - c.x * c.x * (1.0f - cosine * cosine);
      return k < 0.0f ? Vec3f{} : a * c.x - n * (c.x * cosine + std::sqrt(k));
    }
    case M::faceforward:
      return dot(c, b) < 0.0f ? a : -a;
    case M::dot_product:
      return all(dot(a, b));
    case M::distance:
      return all(length(a - b));
    case M::length:
      return all(length(a));
    case M::scale:
      return a * b.x;
    case M::normalize:
      return normalize(a);
    case M::absolute:
      return max(a, -a);
    case M::minimum:
      return min(a, b);
    case M::maximum:
      return max(a, b);
    case M::floor:
      return each(a, [](float x) { return std::floor(x); });
    case M::ceil:
      return each(a, [](float x) { return std::ceil(x); });
    case M::fraction:
      return each(a, fraction);
    case M::modulo:
      return each(a, b, modulo);
    case M::wrap:
      return each(a, b, c, wrapped);
    case M::snap:
      return each(a, b, snapped);
    case M::sine:
      return each(a, [](float x) { return std::sin(x); });
    case M::cosine:
      return each(a, [](float x) { return std::cos(x); });
    case M::tangent:
    default:
      return each(a, [](float x) { return std::tan(x); });
  }
}

// About x, then y, then z.
struct Rotation {
  Vec3f rows[3];
  explicit Rotation(const Vec3f& angles) {
    const float cx = std::cos(angles.x), sx = std::sin(angles.x), cy = std::cos(angles.y), sy = std::sin(angles.y),
                cz = std::cos(angles.z), sz = std::sin(angles.z);
    rows[0] = {cy * cz, sx * sy * cz - cx * sz, cx * sy * cz + sx * sz};
    rows[1] = {cy * sz, sx * sy * sz + cx * cz, cx * sy * sz - sx * cz};
    rows[2] = {-sy, sx * cy, cx * cy};
  }
  Vec3f operator()(const Vec3f& v) const { return {dot(rows[0], v), dot(rows[1], v), dot(rows[2], v)}; }
  Vec3f back(const Vec3f& v) const { return rows[0] * v.x + rows[1] * v.y + rows[2] * v.z; }
};

Vec3f about_axis(const Vec3f& v, const Vec3f& axis, float angle) {
  const float c = std::cos(angle), s = std::sin(angle);
  return v * c + cross(axis, v) * s + axis * (dot(axis, v) * (1.0f - c));
}

Vec3f mapped(uint32_t mode, const Vec3f& v, const Vec3f& place, const Vec3f& angles, const Vec3f& scale) {
  const Rotation turn(angles);
  switch (mode) {
    case 0:
      return turn(v * scale) + place;
    case 1:
      return each(turn.back(v - place), scale, divided);
    case 2:
      return turn(v * scale);
    default:
      return normalize(turn(each(v, scale, divided)));
  }
}

Vec3f rotated(uint32_t mode, const Vec3f& v, const Vec3f& center, const Vec3f& by, float angle) {
  const bool inverse = mode >= 5;
  const uint32_t kind = mode % 5;
  const Vec3f from = v - center;
  if (kind == 4) {
    const Rotation turn(by);
    return (inverse ? turn.back(from) : turn(from)) + center;
  }
  const Vec3f axis =
      kind == 0 ? normalize(by) : Vec3f{kind == 1 ? 1.0f : 0.0f, kind == 2 ? 1.0f : 0.0f, kind == 3 ? 1.0f : 0.0f};
  return axis == Vec3f{} ? v : about_axis(from, axis, inverse ? -angle : angle) + center;
}

// Modes: the kind, 0 linear, 1 in steps, 2 and 3 eased; + 4: kept within the range; + 8: 0 where there is no range.
float ranged(uint32_t mode, float x, float a, float b, float c, float d, float steps) {
  const uint32_t kind = mode & 3u;
  if (kind >= 2) {
    const bool down = a > b;
    if (down) std::swap(a, b);
    float t = b > a ? std::clamp((x - a) / (b - a), 0.0f, 1.0f) : (x < a ? 0.0f : 1.0f);
    t = kind == 2 ? t * t * (3.0f - 2.0f * t) : t * t * t * (t * (t * 6.0f - 15.0f) + 10.0f);
    if (down) t = 1.0f - t;
    return a == b && (mode & 8u) != 0 ? 0.0f : c + t * (d - c);
  }
  if (a == b && (mode & 8u) != 0) return 0.0f;
  float t = divided(x - a, b - a);
  if (kind == 1) t = steps > 0.0f ? std::floor(t * (steps + 1.0f)) / steps : 0.0f;
  const float y = c + t * (d - c);
  return (mode & 4u) != 0 ? std::clamp(y, std::min(c, d), std::max(c, d)) : y;
}

Vec3f color_op(uint32_t mode, const Vec3f& a, const Vec3f& b, const Vec3f& c, const Vec3f& d) {
  switch (mode) {
    case 0:
      return hsv_of(a);
    case 1:
      return of_hsv(a);
    case 2:
      return hsl_of(a);
    case 3:
      return of_hsl(a);
    case 4:
      return each(a, [&](float x) { return b.x == 0.0f ? 1.0f : (x > 0.0f ? std::pow(x, b.x) : x); });
    case 5:
      return each(a, [&](float x) { return std::max((1.0f + c.x) * x + b.x - 0.5f * c.x, 0.0f); });
    default: {
      Vec3f hsv = hsv_of(a);
      hsv.x = std::fmod(hsv.x + b.x + 0.5f, 1.0f);
      hsv.y = std::clamp(hsv.y * c.x, 0.0f, 1.0f), hsv.z *= d.x;
      return of_hsv(hsv);
    }
  }
}

// Of `n` colours between 0 and 1.
Vec3f ramp(const float* table, size_t n, float x, bool steps) {
  const float at = (x > 0.0f ? std::min(x, 1.0f) : 0.0f) * static_cast<float>(n - 1);
  const size_t i = std::min(static_cast<size_t>(at), n - 1);
  const Vec3f a{table[3 * i], table[3 * i + 1], table[3 * i + 2]};
  const float t = at - static_cast<float>(i);
  if (steps || !(t > 0.0f) || i + 1 >= n) return a;
  return a * (1.0f - t) + Vec3f{table[3 * i + 3], table[3 * i + 4], table[3 * i + 5]} * t;
}

// `table`: the ends of its range, then a value of each channel's curve at n places between them.
float curve(const float* table, size_t n, int channel, float x, bool extrapolate) {
  const float low = table[0], high = table[1], t = divided(x - low, high - low);
  const auto value = [&](size_t i) { return table[2 + 3 * i + static_cast<size_t>(channel)]; };
  const auto last = static_cast<float>(n - 1);
  if (extrapolate && n > 1) {
    if (t < 0.0f) return value(0) + (value(0) - value(1)) * -t * last;
    if (t > 1.0f) return value(n - 1) + (value(n - 1) - value(n - 2)) * (t - 1.0f) * last;
  }
  const float at = (t > 0.0f ? std::min(t, 1.0f) : 0.0f) * last;
  const size_t i = std::min(static_cast<size_t>(at), n - 1);
  const float f = at - static_cast<float>(i);
  return i + 1 < n ? value(i) * (1.0f - f) + value(i + 1) * f : value(i);
}

// Reflectance of a dielectric's border.
float border(float cosine, float ior) {
  const float c = std::abs(cosine), g2 = ior * ior - 1.0f + c * c;
  if (!(g2 > 0.0f)) return 1.0f;
  const float g = std::sqrt(g2), a = (g - c) / (g + c), b = (c * (g + c) - 1.0f) / (c * (g - c) + 1.0f);
  return 0.5f * a * a * (1.0f + b * b);
}

float by_view(uint32_t mode, float x, const Vec3f& normal, const ProgramPoint& p) {
  const float cosine = dot(normal, p.to_viewer);
  if (mode == 2) {
    float share = x;
    const float c = std::abs(cosine);
    if (share == 0.5f) return 1.0f - c;
    share = std::clamp(share, 0.0f, 1.0f - 1e-5f);
    return 1.0f - std::pow(c, share < 0.5f ? 2.0f * share : 0.5f / (1.0f - share));
  }
  const float ior = mode == 0 ? std::max(x, 1e-5f) : 1.0f / std::max(1.0f - x, 1e-5f);
  return border(cosine, p.behind ? 1.0f / ior : ior);
}

// Components of an attribute at a place; 0 where the mesh has none.
std::array<float, 4> attribute_at(const ProgramPoint& p, uint32_t id) {
  std::array<float, 4> out{};
  const MeshAttribute* a = p.mesh == nullptr ? nullptr : p.mesh->attribute(id);
  if (a == nullptr || a->components > 4) return out;
  const size_t n = a->components;
  if (a->domain == AttributeDomain::vertex) {
    const uint32_t* corner = &p.mesh->indices[3 * size_t{p.triangle}];
    const float weights[3] = {1.0f - p.u - p.v, p.u, p.v};
    for (size_t k = 0; k < n; ++k)
      for (int c = 0; c < 3; ++c) out[k] += weights[c] * a->values[n * corner[c] + k];
  } else {
    const size_t at = n * (a->domain == AttributeDomain::triangle ? p.triangle : p.instance);
    std::copy_n(a->values.begin() + static_cast<std::ptrdiff_t>(at), n, out.begin());
  }
  if (n == 1) out[1] = out[2] = out[0];
  if (n < 4) out[3] = 1.0f;
  return out;
}

Transform transform_of(const ProgramPoint& p, uint32_t id) {
  Transform t;
  const MeshAttribute* a = p.mesh == nullptr ? nullptr : p.mesh->attribute(id);
  if (a != nullptr && a->components == 12 && a->domain == AttributeDomain::instance)
    std::copy_n(a->values.begin() + 12 * static_cast<std::ptrdiff_t>(p.instance), 12, t.m);
  return t;
}

Vec3f seen_by(const Camera& camera, uint32_t mode, const Vec3f& position) {
  const Vec3f to = position - camera.position;
  const Vec3f local{dot(to, camera.right), dot(to, camera.up), dot(to, camera.forward)};
  switch (mode) {
    case 0: {  // on the image, in its heights from its centre
      const float height = camera.orthographic ? camera.height : 2.0f * camera.tan_half_fov_y * local.z;
      return {divided(local.x, height) - camera.shift_x, divided(local.y, height) - camera.shift_y, 0.0f};
    }
    case 1:
      return normalize(local);
    case 2:
      return all(local.z);
    default:
      return all(length(local));
  }
}

Vec3f projected(uint32_t mode, const Vec3f& v) {
  switch (mode) {
    case 0: {  // onto a sphere in the unit cube
      const Vec3f d = (v - all(0.5f)) * 2.0f;
      const float l = length(d);
      if (!(l > 0.0f)) return {};
      const float u = d.x == 0.0f && d.y == 0.0f ? 0.0f : 0.5f * (1.0f - std::atan2(d.x, d.y) / kPi);
      return {u, 1.0f - std::acos(std::clamp(d.z / l, -1.0f, 1.0f)) / kPi, 0.0f};
    }
    case 1: {  // onto a tube
      const Vec3f d = (v - all(0.5f)) * 2.0f;
      if (!(std::hypot(d.x, d.y) > 0.0f)) return {};
      return {0.5f * (1.0f - std::atan2(d.x, d.y) / kPi), 0.5f * (d.z + 1.0f), 0.0f};
    }
    case 2: {  // latitude and longitude
      const Vec3f d = normalize(v);
      return {0.5f - std::atan2(d.y, d.x) / (2.0f * kPi), 0.5f + std::atan2(d.z, std::hypot(d.x, d.y)) / kPi, 0.0f};
    }
    default: {  // a mirror ball
      Vec3f d = normalize(v);
      d.y -= 1.0f;
      const float size = 2.0f * std::sqrt(std::max(-0.5f * d.y, 0.0f));
      if (size > 0.0f) d = d / size;
      return {0.5f * (d.x + 1.0f), 0.5f * (d.z + 1.0f), 0.0f};
    }
  }
}

// Beyond its borders a clipped image has black texels, which the filter mixes in within half a texel.
Rgb looked_up(const Texture& image, uint32_t mode, float u, float v) {
  if ((mode & 1u) != 0) {
    if (image.nearest()) return u >= 0.0f && u <= 1.0f && v >= 0.0f && v <= 1.0f ? image.color(u, v) : Rgb{};
    const auto inside = [](float x, uint32_t texels) {
      return std::clamp(std::min(x, 1.0f - x) * static_cast<float>(texels) + 0.5f, 0.0f, 1.0f);
    };
    return image.color(u, v) * (inside(u, image.width()) * inside(v, image.height()));
  }
  if ((mode & 2u) != 0) {
    const auto folded = [](float x) {
      const float t = x - 2.0f * std::floor(0.5f * x);
      return t > 1.0f ? 2.0f - t : t;
    };
    u = folded(u), v = folded(v);
  }
  return image.color(u, v);
}

// From three sides, by the normal; `share`: of the borders' width. As Blender's box mapping.
Rgb box_image(const Texture& image, uint32_t mode, const Vec3f& at, float share, const Vec3f& normal) {
  Vec3f n = max(normal, -normal);
  n = n / std::max(n.x + n.y + n.z, 1e-20f);
  const float limit = 0.5f * (1.0f + share), half = 0.5f * (1.0f - share);
  Vec3f weight{};
  const auto pair = [&](float a, float b) {
    const float t = a / (a + b);
    return share > 0.0f ? std::clamp((t - half) / share, 0.0f, 1.0f) : (t > 0.5f ? 1.0f : 0.0f);
  };
  if (n.x > limit * (n.x + n.y) && n.x > limit * (n.x + n.z)) {
    weight.x = 1.0f;
  } else if (n.y > limit * (n.x + n.y) && n.y > limit * (n.y + n.z)) {
    weight.y = 1.0f;
  } else if (n.z > limit * (n.x + n.z) && n.z > limit * (n.y + n.z)) {
    weight.z = 1.0f;
  } else if (share > 0.0f) {
    if (n.z < (1.0f - limit) * (n.x + n.y)) {
      weight.x = pair(n.x, n.y), weight.y = 1.0f - weight.x;
    } else if (n.x < (1.0f - limit) * (n.y + n.z)) {
      weight.y = pair(n.y, n.z), weight.z = 1.0f - weight.y;
    } else if (n.y < (1.0f - limit) * (n.x + n.z)) {
      weight.x = pair(n.x, n.z), weight.z = 1.0f - weight.x;
    } else {
      const auto of = [&](float a) { return ((2.0f - limit) * a + (limit - 1.0f)) / (2.0f * limit - 1.0f); };
      weight = {of(n.x), of(n.y), of(n.z)};
    }
  } else {
    weight.x = 1.0f;
  }
  Rgb sum{};
  if (weight.x > 0.0f) sum += looked_up(image, mode, normal.x < 0.0f ? 1.0f - at.y : at.y, at.z) * weight.x;
  if (weight.y > 0.0f) sum += looked_up(image, mode, normal.y > 0.0f ? 1.0f - at.x : at.x, at.z) * weight.y;
  if (weight.z > 0.0f) sum += looked_up(image, mode, normal.z > 0.0f ? 1.0f - at.y : at.y, at.x) * weight.z;
  return sum;
}

// The point's triangle in the world, and its texture coordinates.
struct TrianglePlace {
  Vec3f edges[2];
  Vec2f uvs[3];
};
Vec3f corner_at(const ProgramPoint& p, int k) {
  const Vec3f& local = p.mesh->positions[p.mesh->indices[3 * size_t{p.triangle} + static_cast<size_t>(k)]];
  return p.to_world == nullptr ? local : p.to_world->point(local);
}

// Bent by a tangent-space colour, in the frame of the coordinates' growing u. As Scene::mapped_normal.
Vec3f by_normal_map(const ProgramPoint& p, const Vec3f& color, float strength, const Vec2f (&uv)[3]) {
  const Vec3f a = corner_at(p, 0), e1 = corner_at(p, 1) - a, e2 = corner_at(p, 2) - a;
  const Vec2f d1{uv[1].x - uv[0].x, uv[1].y - uv[0].y}, d2{uv[2].x - uv[0].x, uv[2].y - uv[0].y};
  const float det = d1.x * d2.y - d2.x * d1.y;
  if (!(std::abs(det) > 0.0f)) return p.normal;
  const Vec3f along_u = (e1 * d2.y - e2 * d1.y) / det, along_v = (e2 * d1.x - e1 * d2.x) / det;
  const float side = p.behind ? -1.0f : 1.0f;  // the frame is the front's
  const Vec3f n = p.normal * side;
  const Vec3f t = normalize(along_u - n * dot(along_u, n));
  if (t == Vec3f{} || !is_finite(t)) return p.normal;
  Vec3f b = cross(n, t);
  if (dot(b, along_v) < 0.0f) b = -b;
  const Vec3f c = color * 2.0f - all(1.0f);
  const Vec3f bent = normalize(t * c.x + b * c.y + n * c.z) * side;
  const Vec3f out = normalize(p.normal + (bent - p.normal) * std::max(strength, 0.0f));
  return out == Vec3f{} || !is_finite(out) ? p.normal : out;
}

std::string at(size_t i, const char* op, const char* field) {
  return "instruction[" + std::to_string(i) + "] (" + op + ")." + field;
}

}  // namespace

std::span<const ProgramOpInfo> program_ops() { return kOps; }

TextureProgram::TextureProgram(std::vector<ProgramInstruction> instructions, std::vector<Vec3f> constants,
                               std::vector<float> table)
    : instructions_(std::move(instructions)), constants_(std::move(constants)), table_(std::move(table)) {
  if (instructions_.empty()) fail_argument("instructions: there is none");
  if (instructions_.size() > kMostInstructions)
    fail_argument("instructions: " + std::to_string(instructions_.size()) + " are more than " +
                  std::to_string(kMostInstructions));
  for (size_t i = 0; i < constants_.size(); ++i)
    if (!is_finite(constants_[i])) fail_argument("constants[" + std::to_string(i) + "] is not finite");
  for (size_t i = 0; i < table_.size(); ++i)
    if (!std::isfinite(table_[i]))
      fail_argument("table[" + std::to_string(i) + "]: " + number_text(table_[i]) + " is not finite");
  for (size_t i = 0; i < instructions_.size(); ++i) {
    ProgramInstruction& in = instructions_[i];
    if (in.op >= std::size(kOps))
      throw Error(ErrorCode::unsupported,
                  "instruction[" + std::to_string(i) + "].op: " + std::to_string(in.op) + " is not known");
    const ProgramOpInfo& op = kOps[in.op];
    if (in.mode >= op.modes)
      throw Error(ErrorCode::unsupported, at(i, op.name, "mode") + ": " + std::to_string(in.mode) + " is not below " +
                                              std::to_string(op.modes));
    for (size_t k = 0; k < kMostProgramInputs; ++k) {
      const int32_t from = in.inputs[k];
      const auto where = [&] { return at(i, op.name, "inputs") + "[" + std::to_string(k) + "]: "; };
      if (k >= op.inputs) {
        if (from != 0)
          fail_argument(where() + std::to_string(from) + " is not 0; it takes " + std::to_string(op.inputs));
      } else if (from >= static_cast<int64_t>(i)) {
        fail_argument(where() + std::to_string(from) + " is no earlier instruction");
      } else if (from < 0 && -1 - int64_t{from} >= static_cast<int64_t>(constants_.size())) {
        fail_argument(where() + std::to_string(from) + " is out of range: there are " +
                      std::to_string(constants_.size()) + " constants");
      }
    }
    const auto wrong = [&](const char* field, uint64_t value, const std::string& text) {
      fail_argument(at(i, op.name, field) + ": " + std::to_string(value) + " " + text);
    };
    if (in.op == static_cast<uint32_t>(ProgramOp::transform) && in.count != 0 && in.count != 12)
      wrong("count", in.count, "is neither 0, for an attribute, nor 12");
    const bool tabled = op.data == ProgramData::table || (op.data == ProgramData::transform && in.count != 0);
    if (!tabled && in.count != 0) wrong("count", in.count, "is not 0");
    if (op.data == ProgramData::none && in.data != 0) wrong("data", in.data, "is not 0");
    if (!tabled) continue;
    if (uint64_t{in.data} + in.count > table_.size())
      wrong("data", in.data,
            "with count " + std::to_string(in.count) + " is beyond the table's " + std::to_string(table_.size()));
    switch (static_cast<ProgramOp>(in.op)) {
      case ProgramOp::ramp:
        if (in.count == 0 || in.count % 3 != 0) wrong("count", in.count, "is no multiple of 3 above 0");
        break;
      case ProgramOp::curves:
        if (in.count < 5 || (in.count - 2) % 3 != 0) wrong("count", in.count, "is not 2 and a multiple of 3 above 0");
        break;
      case ProgramOp::brick:
        if (in.count != 4) wrong("count", in.count, "is not 4");
        for (uint32_t k = 2; k < 4; ++k)
          if (!(std::abs(table_[in.data + k]) <= 1e6f))
            wrong("data", in.data, "leads to a frequency of " + number_text(table_[in.data + k]));
        break;
      default:
        break;
    }
  }
  // What each bump's height is computed from.
  for (size_t i = 0; i < instructions_.size(); ++i) {
    ProgramInstruction& in = instructions_[i];
    if (in.op != static_cast<uint32_t>(ProgramOp::bump)) continue;
    in.data = static_cast<uint32_t>(heights_.size());
    std::vector<bool> used(i, false);
    if (in.inputs[0] >= 0) used[static_cast<size_t>(in.inputs[0])] = true;
    std::vector<uint32_t> list;
    for (size_t k = i; k-- > 0;) {
      if (!used[k]) continue;
      list.push_back(static_cast<uint32_t>(k));
      const ProgramInstruction& of = instructions_[k];
      // A bump within a height is its own normal there.
      const bool bump = of.op == static_cast<uint32_t>(ProgramOp::bump);
      for (size_t n = bump ? 3 : 0; n < kOps[of.op].inputs; ++n)
        if (of.inputs[n] >= 0) used[static_cast<size_t>(of.inputs[n])] = true;
    }
    std::reverse(list.begin(), list.end());
    heights_.push_back(std::move(list));
  }
}

Rgb TextureProgram::evaluate(const ProgramPoint& point, std::span<const Texture> textures) const {
  // Left as it is: most programs use little of it.
  alignas(Vec3f) unsigned char memory[kMostInstructions * sizeof(Vec3f)];
  auto* values = reinterpret_cast<Vec3f*>(memory);
  for (size_t i = 0; i < instructions_.size(); ++i) {
    // A thousand noises take longer than a cancel may.
    if (i % 16 == 0 && CurrentWork::cancelled()) return {};
    new (&values[i]) Vec3f(value(instructions_[i], point, textures, values, false));
  }
  const Vec3f& last = values[instructions_.size() - 1];
  return is_finite(last) ? last : each(last, [](float x) { return std::isfinite(x) ? x : 0.0f; });
}

// Over which slopes are taken unless told, as a share of the distance: about a pixel of a view of some thousand.
constexpr float kBumpWidth = 5e-4f;

// [Mikkelsen 2010, "Bump mapping unparametrized surfaces on the GPU"], the slopes by differences over a step.
Vec3f TextureProgram::bump(const ProgramInstruction& in, const ProgramPoint& p, std::span<const Texture> textures,
                           const Vec3f* values) const {
  const auto input = [&](size_t k) -> const Vec3f& {
    return in.inputs[k] >= 0 ? values[in.inputs[k]] : constants_[static_cast<size_t>(-1 - in.inputs[k])];
  };
  const Vec3f normal = input(3);
  const float strength = std::max(input(1).x, 0.0f), distance = input(2).x;
  const float width = input(4).x, step = std::max(p.least_step, (width > 0.0f ? width : kBumpWidth) * p.distance);
  if (p.mesh == nullptr || !(p.least_step > 0.0f) || in.inputs[0] < 0 || strength == 0.0f || distance == 0.0f)
    return normal;
  const Vec3f a = corner_at(p, 0), e1 = corner_at(p, 1) - a, e2 = corner_at(p, 2) - a;
  const float l11 = dot(e1, e1), l12 = dot(e1, e2), l22 = dot(e2, e2), det = l11 * l22 - l12 * l12;
  if (!(det > 0.0f)) return normal;
  const Frame frame(normalize(cross(e1, e2)));
  const Vec3f* along[2] = {&frame.t, &frame.b};
  float slopes[2];
  const float here = input(0).x;
  alignas(Vec3f) unsigned char memory[kMostInstructions * sizeof(Vec3f)];
  auto* shifted = reinterpret_cast<Vec3f*>(memory);
  for (int k = 0; k < 2; ++k) {
    const Vec3f d = *along[k] * step;
    const float d1 = dot(d, e1), d2 = dot(d, e2);
    const float du = (d1 * l22 - d2 * l12) / det, dv = (d2 * l11 - d1 * l12) / det;
    ProgramPoint q = p;
    q.position += d, q.u += du, q.v += dv;
    if (!p.mesh->uvs.empty()) {
      const uint32_t* t = &p.mesh->indices[3 * size_t{p.triangle}];
      const Vec2f u0 = p.mesh->uvs[t[0]], u1 = p.mesh->uvs[t[1]], u2 = p.mesh->uvs[t[2]];
      q.uv.x += du * (u1.x - u0.x) + dv * (u2.x - u0.x), q.uv.y += du * (u1.y - u0.y) + dv * (u2.y - u0.y);
    }
    for (uint32_t i : heights_[in.data]) new (&shifted[i]) Vec3f(value(instructions_[i], q, textures, shifted, true));
    slopes[k] = (shifted[in.inputs[0]].x - here) / step;
  }
  // The slope lies in the shading normal's plane.
  Vec3f slope = frame.t * slopes[0] + frame.b * slopes[1];
  slope -= normal * dot(slope, normal);
  const Vec3f bent = normalize(normal - slope * distance);
  const Vec3f out = normalize(bent * strength + normal * (1.0f - strength));
  return out == Vec3f{} || !is_finite(out) ? normal : out;
}

Vec3f TextureProgram::value(const ProgramInstruction& in, const ProgramPoint& p, std::span<const Texture> textures,
                            const Vec3f* values, bool within_bump) const {
  const auto input = [&](size_t k) -> const Vec3f& {
    return in.inputs[k] >= 0 ? values[in.inputs[k]] : constants_[static_cast<size_t>(-1 - in.inputs[k])];
  };
  const auto number = [&](size_t k) { return input(k).x; };
  const auto place = [&](size_t vector, size_t w) {
    const Vec3f& v = input(vector);
    return Vec4f{v.x, v.y, v.z, number(w)};
  };
  // In one dimension the number alone counts.
  const auto place_of = [&](int dimensions) {
    const Vec4f v = place(0, 1);
    return dimensions == 1 ? Vec4f{v.w, 0, 0, 0} : v;
  };
  // Of ramps and curves; attributes and images number other things with `data`.
  const float* table = in.data < table_.size() ? table_.data() + in.data : nullptr;
  switch (static_cast<ProgramOp>(in.op)) {
    case ProgramOp::uv:
      return {p.uv.x, p.uv.y, 0.0f};
    case ProgramOp::attribute: {
      const auto a = attribute_at(p, in.data);
      return in.mode == 0 ? Vec3f{a[0], a[1], a[2]} : all(a[3]);
    }
    case ProgramOp::position:
      return p.position;
    case ProgramOp::normal:
      return in.mode == 0 ? p.normal : p.geometric_normal;
    case ProgramOp::to_viewer:
      return p.to_viewer;
    case ProgramOp::behind:
      return all(p.behind ? 1.0f : 0.0f);
    case ProgramOp::camera:
      return p.camera == nullptr ? Vec3f{} : seen_by(*p.camera, in.mode, p.position);
    case ProgramOp::transform: {
      Transform t;
      if (in.count == 0)
        t = transform_of(p, in.data);
      else
        std::copy_n(table, 12, t.m);
      return in.mode == 0 ? t.point(input(0)) : (in.mode == 1 ? t.vector(input(0)) : t.normal(input(0)));
    }
    case ProgramOp::math:
      return all(math(static_cast<MathMode>(in.mode), number(0), number(1), number(2)));
    case ProgramOp::vector:
      return vector_math(static_cast<VectorMode>(in.mode), input(0), input(1), input(2));
    case ProgramOp::grey: {
      const Vec3f& v = input(0);
      return all(in.mode == 0 ? luminance(v) : (v.x + v.y + v.z) * (1.0f / 3.0f));
    }
    case ProgramOp::separate:
      return all(input(0)[static_cast<int>(in.mode)]);
    case ProgramOp::combine:
      return {number(0), number(1), number(2)};
    case ProgramOp::clamp:
      return each(input(0), input(1), input(2), [&](float x, float low, float high) {
        if (in.mode == 1 && low > high) std::swap(low, high);
        return std::min(std::max(x, low), high);
      });
    case ProgramOp::map_range: {
      const Vec3f &x = input(0), &a = input(1), &b = input(2), &c = input(3), &d = input(4), &s = input(5);
      return {ranged(in.mode, x.x, a.x, b.x, c.x, d.x, s.x), ranged(in.mode, x.y, a.y, b.y, c.y, d.y, s.y),
              ranged(in.mode, x.z, a.z, b.z, c.z, d.z, s.z)};
    }
    case ProgramOp::mapping:
      return mapped(in.mode, input(0), input(1), input(2), input(3));
    case ProgramOp::rotate:
      return rotated(in.mode, input(0), input(1), input(2), number(3));
    case ProgramOp::mix:
      return blend(static_cast<BlendMode>(in.mode), number(0), input(1), input(2));
    case ProgramOp::color:
      return color_op(in.mode, input(0), input(1), input(2), input(3));
    case ProgramOp::ramp:
      return ramp(table, in.count / 3, number(0), in.mode == 1);
    case ProgramOp::curves: {
      const float share = number(0);
      const Vec3f& c = input(1);
      const size_t n = (in.count - 2) / 3;
      Vec3f out;
      for (int k = 0; k < 3; ++k) out[k] = (1.0f - share) * c[k] + share * curve(table, n, k, c[k], in.mode == 1);
      return out;
    }
    case ProgramOp::fresnel:
      return all(by_view(in.mode, number(0), input(1), p));
    case ProgramOp::bump:
      return within_bump ? input(3) : bump(in, p, textures, values);
    case ProgramOp::normal_map: {
      if (p.mesh == nullptr) return p.normal;
      const uint32_t* t = &p.mesh->indices[3 * size_t{p.triangle}];
      Vec2f uv[3]{};
      if (in.mode == 1) {
        const MeshAttribute* a = p.mesh->attribute(in.data);
        if (a == nullptr || a->components < 2 || a->components > 4 || a->domain != AttributeDomain::vertex)
          return p.normal;
        for (int k = 0; k < 3; ++k) {
          const float* of = &a->values[size_t{a->components} * t[k]];
          uv[k] = {of[0], of[1]};
        }
      } else if (!p.mesh->uvs.empty()) {
        for (int k = 0; k < 3; ++k) uv[k] = p.mesh->uvs[t[k]];
      }
      return by_normal_map(p, input(0), number(1), uv);
    }
    case ProgramOp::noise: {
      const auto share = [](float x) { return std::clamp(x, 0.0f, 1.0f); };
      NoiseOptions o;
      o.dimensions = static_cast<int>(in.mode % 4) + 1;
      o.detail = number(2), o.roughness = in.mode >= 40 ? share(number(3)) : std::max(number(3), 0.0f);
      o.lacunarity = number(4);
      o.offset = number(5), o.gain = number(6), o.normalize = in.mode >= 40;
      const auto kind = static_cast<NoiseKind>(in.mode / 4 % 5);
      const Vec4f at = place_of(o.dimensions);
      return in.mode / 20 % 2 == 0 ? all(noise_texture(at, number(7), kind, o))
                                   : noise_texture_color(at, number(7), kind, o);
    }
    case ProgramOp::musgrave: {
      NoiseOptions o;
      o.dimensions = static_cast<int>(in.mode % 4) + 1;
      o.detail = number(2), o.lacunarity = std::max(number(4), 1e-5f);
      o.roughness = std::pow(o.lacunarity, -std::max(number(3), 1e-5f));
      o.offset = number(5), o.gain = number(6);
      return all(musgrave_noise(place_of(o.dimensions), static_cast<NoiseKind>(in.mode / 4), o));
    }
    case ProgramOp::voronoi: {
      VoronoiOptions o;
      o.dimensions = static_cast<int>(in.mode % 4) + 1;
      o.feature = static_cast<VoronoiFeature>(in.mode / 4 % 5);
      o.metric = static_cast<VoronoiMetric>(in.mode / 20 % 4);
      o.smoothness = std::clamp(0.5f * number(2), 0.0f, 0.5f), o.exponent = number(3);
      o.randomness = std::clamp(number(4), 0.0f, 1.0f);
      const VoronoiCell cell = voronoi(place_of(o.dimensions), o);
      switch (in.mode / 80) {
        case 0:
          return all(cell.distance);
        case 1:
          return cell.color;
        case 2:
          return {cell.position.x, cell.position.y, cell.position.z};
        default:
          return all(o.dimensions == 1 ? cell.position.x : cell.position.w);
      }
    }
    case ProgramOp::wave: {
      WaveOptions o;
      o.rings = in.mode % 2 == 1;
      o.direction = static_cast<WaveDirection>(in.mode / 2 % 4);
      o.profile = static_cast<WaveProfile>(in.mode / 8);
      o.distortion = number(1), o.detail = number(2), o.detail_scale = number(3), o.detail_roughness = number(4);
      o.phase = number(5);
      return all(wave(input(0), o));
    }
    case ProgramOp::magic:
      return magic(input(0), static_cast<int>(in.mode), number(1));
    case ProgramOp::brick: {
      BrickOptions o;
      o.offset = table[0], o.squash = table[1];
      o.offset_frequency = static_cast<int>(table[2]), o.squash_frequency = static_cast<int>(table[3]);
      o.mortar_size = number(1), o.mortar_smooth = number(2), o.bias = number(3), o.width = number(4);
      o.height = number(5);
      const Brick b = brick(input(0), o);
      return {b.mortar, b.tint, 0.0f};
    }
    case ProgramOp::checker:
      return all(checker(input(0)));
    case ProgramOp::gradient:
      return all(gradient(input(0), static_cast<GradientKind>(in.mode)));
    case ProgramOp::white_noise: {
      const int dimensions = static_cast<int>(in.mode % 4) + 1;
      const Rgb c = hash_color(place_of(dimensions), dimensions);
      return in.mode < 4 ? all(c.x) : c;
    }
    case ProgramOp::project:
      return projected(in.mode, input(0));
    case ProgramOp::image: {
      const Vec3f& at = input(0);
      const Texture& image = textures[in.data];
      return (in.mode & 4u) != 0 ? box_image(image, in.mode, at, std::clamp(number(1), 0.0f, 1.0f), input(2))
                                 : looked_up(image, in.mode, at.x, at.y);
    }
  }
  return {};
}

void TextureProgram::check_textures(std::span<const Texture> textures, const std::string& owner) const {
  for (size_t i = 0; i < instructions_.size(); ++i) {
    const ProgramInstruction& in = instructions_[i];
    if (in.op != static_cast<uint32_t>(ProgramOp::image)) continue;
    if (in.data >= textures.size())
      fail_argument(owner + at(i, "image", "data") + ": " + std::to_string(in.data) +
                    " is out of range: the scene has " + std::to_string(textures.size()) + " textures");
    if (textures[in.data].program() != nullptr || textures[in.data].is_by_view())
      fail_argument(owner + at(i, "image", "data") + ": " + std::to_string(in.data) +
                    (textures[in.data].program() != nullptr ? " is a program" : " is a texture by view") +
                    ", not an image");
  }
}

bool TextureProgram::has(ProgramOp op) const {
  return std::any_of(instructions_.begin(), instructions_.end(),
                     [&](const ProgramInstruction& in) { return in.op == static_cast<uint32_t>(op); });
}
bool TextureProgram::asks_for_camera() const { return has(ProgramOp::camera); }
bool TextureProgram::varies_with_instance() const {
  return has(ProgramOp::attribute) || has(ProgramOp::transform) || has(ProgramOp::position) || has(ProgramOp::normal) ||
         asks_for_camera();
}
bool TextureProgram::varies_with_view() const {
  return has(ProgramOp::to_viewer) || has(ProgramOp::fresnel) || has(ProgramOp::behind);
}

}  // namespace lumicut
