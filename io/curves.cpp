#include "io/curves.h"

#include <algorithm>
#include <cmath>

namespace lumicut::io {

namespace {

constexpr double kBend = 0.25;  // of the radius: how far a strand may lie off its curve
constexpr double kMostPieces = 64;
constexpr size_t kManyPieces = 20000;

CurvePoint mixed(const CurvePoint& a, const CurvePoint& b, double t) {
  return {a.place * (1 - t) + b.place * t, a.radius * (1 - t) + b.radius * t, a.normal * (1 - t) + b.normal * t};
}

}  // namespace

Strand bezier_strand(const Strand& points, size_t degree) {
  Strand out;
  if (points.size() > degree) out.push_back(points[0]);
  for (size_t first = 0; first + degree < points.size(); first += degree) {
    double bend = 0, radius = 0;
    for (size_t i = first; i <= first + degree; ++i) radius = std::max(radius, points[i].radius);
    for (size_t i = first; i + 2 <= first + degree; ++i)
      bend = std::max(bend, length(points[i].place - points[i + 1].place * 2 + points[i + 2].place));
    // Wang's bound of how far chords lie off the curve.
    const double d = double(degree), wanted = std::sqrt(d * (d - 1) / 8 * bend / (kBend * radius));
    const size_t pieces = static_cast<size_t>(wanted > 1 ? std::min(std::ceil(wanted), kMostPieces) : 1);
    for (size_t i = 1; i <= pieces; ++i) {
      const double t = double(i) / double(pieces);
      CurvePoint row[4];
      std::copy_n(&points[first], degree + 1, row);
      for (size_t left = degree; left > 0; --left)
        for (size_t k = 0; k < left; ++k) row[k] = mixed(row[k], row[k + 1], t);
      out.push_back(row[0]);
    }
  }
  return out;
}

Strand bezier_of_bspline(const Strand& points, size_t degree) {
  const auto sum = [&](size_t first, std::initializer_list<double> weights) {
    CurvePoint out;
    for (const double w : weights) {
      const CurvePoint& p = points[first++];
      out.place = out.place + p.place * w, out.normal = out.normal + p.normal * w, out.radius += p.radius * w;
    }
    return out;
  };
  Strand out;
  for (size_t i = 0; i + degree < points.size(); ++i) {
    if (degree == 2) {
      if (i == 0) out.push_back(sum(0, {0.5, 0.5}));
      out.push_back(points[i + 1]);
      out.push_back(sum(i + 1, {0.5, 0.5}));
    } else {
      if (i == 0) out.push_back(sum(0, {1 / 6.0, 4 / 6.0, 1 / 6.0}));
      out.push_back(sum(i + 1, {2 / 3.0, 1 / 3.0}));
      out.push_back(sum(i + 1, {1 / 3.0, 2 / 3.0}));
      out.push_back(sum(i + 1, {1 / 6.0, 4 / 6.0, 1 / 6.0}));
    }
  }
  return out;
}

Geometry curve_geometry(const std::vector<Strand>& strands) {
  size_t all_pieces = 0;
  for (const Strand& strand : strands) all_pieces += strand.size();
  const uint32_t sides = all_pieces > kManyPieces ? 3 : 12;
  // A convex body's mean width goes by its perimeter. [Cauchy]
  const double wider = 3.14159265358979323846 / (sides * std::sin(3.14159265358979323846 / sides));
  Geometry g;
  const auto vertex = [&](const Vec& p, const Vec& n, double u, double v) {
    for (const double x : p) g.positions.push_back(static_cast<float>(x));
    for (const double x : n) g.normals.push_back(static_cast<float>(x));
    g.uvs.push_back(static_cast<float>(u)), g.uvs.push_back(static_cast<float>(v));
  };
  const auto triangle = [&](uint32_t a, uint32_t b, uint32_t c) {
    const auto place = [&](uint32_t i) {
      return Vec{g.positions[3 * size_t{i}], g.positions[3 * size_t{i} + 1], g.positions[3 * size_t{i} + 2]};
    };
    if (length(cross(place(b) - place(a), place(c) - place(a))) > 0) g.indices.insert(g.indices.end(), {a, b, c});
  };
  for (const Strand& strand : strands) {
    if (strand.size() < 2) continue;
    std::vector<Vec> along(strand.size());
    Vec most{0, 0, 0};
    for (size_t i = 0; i < strand.size(); ++i) {
      along[i] = unit(strand[std::min(i + 1, strand.size() - 1)].place - strand[i > 0 ? i - 1 : 0].place);
      for (size_t k = 0; k < 3; ++k) most[k] = std::max(most[k], std::abs(along[i][k]));
    }
    // One direction for a whole strand, least along it, keeps the sides from twisting.
    Vec axis{0, 0, 0};
    axis[static_cast<size_t>(std::min_element(most.begin(), most.end()) - most.begin())] = 1;
    const bool ribbon = length(strand[0].normal) > 0;
    const uint32_t ring = ribbon ? 2 : sides, first = static_cast<uint32_t>(g.positions.size() / 3);
    for (size_t i = 0; i < strand.size(); ++i) {
      const CurvePoint& p = strand[i];
      const double u = double(i) / double(strand.size() - 1);
      if (ribbon) {
        const Vec side = unit(cross(p.normal, along[i])), n = unit(cross(along[i], side));
        vertex(p.place - side * p.radius, n, u, 0), vertex(p.place + side * p.radius, n, u, 1);
        continue;
      }
      const Vec side = unit(axis - along[i] * dot(axis, along[i])), other = cross(along[i], side);
      for (uint32_t s = 0; s < sides; ++s) {
        const double angle = 2 * 3.14159265358979323846 * s / sides;
        const Vec n = side * std::cos(angle) + other * std::sin(angle);
        vertex(p.place + n * (p.radius * wider), n, u, 0.5 + 0.5 * std::cos(angle));
      }
    }
    for (uint32_t i = 0; i + 1 < strand.size(); ++i)
      for (uint32_t s = 0; s < (ribbon ? 1 : sides); ++s) {
        const uint32_t a = first + i * ring + s, b = first + i * ring + (s + 1) % ring;
        if (ribbon)
          triangle(a, b + ring, b), triangle(a, a + ring, b + ring);
        else
          triangle(a, b, b + ring), triangle(a, b + ring, a + ring);
      }
  }
  return g;
}

}  // namespace lumicut::io
