// Small fixed vectors. `Vec3f` serves points, directions and linear Rec.709 colour (`Rgb`).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <type_traits>

namespace lumicut {

template <typename T>
struct Vec3 {
  T x{}, y{}, z{};

  constexpr T& operator[](int i) { return i == 0 ? x : (i == 1 ? y : z); }
  constexpr const T& operator[](int i) const { return i == 0 ? x : (i == 1 ? y : z); }
  constexpr bool operator==(const Vec3&) const = default;
};

using Vec3f = Vec3<float>;
using Vec3d = Vec3<double>;
using Rgb = Vec3f;

struct Vec2f {
  float x{}, y{};
  constexpr bool operator==(const Vec2f&) const = default;
};

template <typename T>
constexpr Vec3<T> operator+(const Vec3<T>& a, const Vec3<T>& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <typename T>
constexpr Vec3<T> operator-(const Vec3<T>& a, const Vec3<T>& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <typename T>
constexpr Vec3<T> operator-(const Vec3<T>& a) {
  return {-a.x, -a.y, -a.z};
}
template <typename T>
constexpr Vec3<T> operator*(const Vec3<T>& a, const Vec3<T>& b) {
  return {a.x * b.x, a.y * b.y, a.z * b.z};
}
template <typename T>
constexpr Vec3<T> operator*(const Vec3<T>& a, std::type_identity_t<T> s) {
  return {a.x * s, a.y * s, a.z * s};
}
template <typename T>
constexpr Vec3<T> operator*(std::type_identity_t<T> s, const Vec3<T>& a) {
  return a * s;
}
template <typename T>
constexpr Vec3<T> operator/(const Vec3<T>& a, std::type_identity_t<T> s) {
  return {a.x / s, a.y / s, a.z / s};
}
template <typename T>
constexpr Vec3<T>& operator+=(Vec3<T>& a, const Vec3<T>& b) {
  return a = a + b;
}
template <typename T>
constexpr Vec3<T>& operator-=(Vec3<T>& a, const Vec3<T>& b) {
  return a = a - b;
}
template <typename T>
constexpr Vec3<T>& operator*=(Vec3<T>& a, const Vec3<T>& b) {
  return a = a * b;
}
template <typename T>
constexpr Vec3<T>& operator*=(Vec3<T>& a, std::type_identity_t<T> s) {
  return a = a * s;
}

template <typename T>
constexpr T dot(const Vec3<T>& a, const Vec3<T>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <typename T>
constexpr Vec3<T> cross(const Vec3<T>& a, const Vec3<T>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <typename T>
constexpr T length2(const Vec3<T>& a) {
  return dot(a, a);
}
template <typename T>
T length(const Vec3<T>& a) {
  return std::sqrt(dot(a, a));
}
// The zero vector stays zero.
template <typename T>
Vec3<T> normalize(const Vec3<T>& a) {
  const T l = length(a);
  return l > T(0) ? a / l : a;
}
template <typename T>
constexpr Vec3<T> min(const Vec3<T>& a, const Vec3<T>& b) {
  return {std::min(a.x, b.x), std::min(a.y, b.y), std::min(a.z, b.z)};
}
template <typename T>
constexpr Vec3<T> max(const Vec3<T>& a, const Vec3<T>& b) {
  return {std::max(a.x, b.x), std::max(a.y, b.y), std::max(a.z, b.z)};
}
template <typename T>
constexpr T max_component(const Vec3<T>& a) {
  return std::max(a.x, std::max(a.y, a.z));
}
inline bool is_finite(const Vec3f& a) { return std::isfinite(a.x) && std::isfinite(a.y) && std::isfinite(a.z); }

// Rec.709 luminance of a linear colour.
constexpr float luminance(const Rgb& c) { return 0.2126f * c.x + 0.7152f * c.y + 0.0722f * c.z; }

// Mirror direction of `w` (pointing away from the surface) about the unit normal `n`.
constexpr Vec3f reflect(const Vec3f& w, const Vec3f& n) { return n * (2.0f * dot(w, n)) - w; }

// Orthonormal frame around the unit vector `n`. [Duff et al. 2017, JCGT 6(1)]
struct Frame {
  Vec3f t, b, n;
  explicit Frame(const Vec3f& normal) : n(normal) {
    const float sign = std::copysign(1.0f, n.z);
    const float a = -1.0f / (sign + n.z);
    const float c = n.x * n.y * a;
    t = {1.0f + sign * n.x * n.x * a, sign * c, -sign * n.x};
    b = {c, sign + n.y * n.y * a, -n.y};
  }
  Vec3f to_world(const Vec3f& v) const { return t * v.x + b * v.y + n * v.z; }
  Vec3f to_local(const Vec3f& v) const { return {dot(v, t), dot(v, b), dot(v, n)}; }
};

// Affine map, row-major 3x4: p' = linear·p + translation.
struct Transform {
  float m[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
  constexpr bool operator==(const Transform&) const = default;
  Vec3f point(const Vec3f& p) const {
    return {m[0] * p.x + m[1] * p.y + m[2] * p.z + m[3], m[4] * p.x + m[5] * p.y + m[6] * p.z + m[7],
            m[8] * p.x + m[9] * p.y + m[10] * p.z + m[11]};
  }
  Vec3f vector(const Vec3f& v) const {
    return {m[0] * v.x + m[1] * v.y + m[2] * v.z, m[4] * v.x + m[5] * v.y + m[6] * v.z,
            m[8] * v.x + m[9] * v.y + m[10] * v.z};
  }
  // Normals map by the inverse transpose, up to a positive factor: right under nonuniform scale, and the front stays
  // the front under mirroring. Not normalised.
  Vec3f normal(const Vec3f& n) const {
    const Vec3f c0{m[0], m[4], m[8]}, c1{m[1], m[5], m[9]}, c2{m[2], m[6], m[10]};
    const Vec3f r = cross(c1, c2) * n.x + cross(c2, c0) * n.y + cross(c0, c1) * n.z;
    return dot(c0, cross(c1, c2)) < 0.0f ? -r : r;
  }
  // Of lengths, in the mean: the cube root of what it does to volumes.
  float scale() const {
    return std::cbrt(std::abs(dot(Vec3f{m[0], m[4], m[8]}, cross(Vec3f{m[1], m[5], m[9]}, Vec3f{m[2], m[6], m[10]}))));
  }
};

}  // namespace lumicut
