// Vectors and affine maps in double precision, for readers that place things before they become single precision.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>

namespace lumicut::io {

using Vec = std::array<double, 3>;

inline Vec operator+(const Vec& a, const Vec& b) { return {a[0] + b[0], a[1] + b[1], a[2] + b[2]}; }
inline Vec operator-(const Vec& a, const Vec& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
inline Vec operator*(const Vec& a, double s) { return {a[0] * s, a[1] * s, a[2] * s}; }
inline double dot(const Vec& a, const Vec& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
inline Vec cross(const Vec& a, const Vec& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
inline double length(const Vec& a) { return std::sqrt(dot(a, a)); }
// z where there is no direction.
inline Vec unit(const Vec& v) {
  const double l = length(v);
  return l > 0 ? v * (1 / l) : Vec{0, 0, 1};
}

inline void store(float* out, const Vec& v) {
  for (size_t k = 0; k < 3; ++k) out[k] = static_cast<float>(v[k]);
}

// Three rows of four.
struct Affine {
  std::array<double, 12> m{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};

  Vec column(size_t c) const { return {m[c], m[4 + c], m[8 + c]}; }
  Vec vector(const Vec& v) const { return column(0) * v[0] + column(1) * v[1] + column(2) * v[2]; }
  Vec point(const Vec& p) const { return vector(p) + column(3); }
  // Of a surface, not of unit length: the cofactors, which are the inverse transpose but for the determinant's size.
  Vec normal(const Vec& n) const {
    const Vec x = column(0), y = column(1), z = column(2);
    return (cross(y, z) * n[0] + cross(z, x) * n[1] + cross(x, y) * n[2]) * (determinant() < 0 ? -1.0 : 1.0);
  }
  double determinant() const { return dot(column(0), cross(column(1), column(2))); }
};

inline Affine operator*(const Affine& a, const Affine& b) {
  Affine out;
  for (size_t r = 0; r < 3; ++r)
    for (size_t c = 0; c < 4; ++c) {
      double sum = c == 3 ? a.m[4 * r + 3] : 0;
      for (size_t k = 0; k < 3; ++k) sum += a.m[4 * r + k] * b.m[4 * k + c];
      out.m[4 * r + c] = sum;
    }
  return out;
}

}  // namespace lumicut::io
