#include "geometry/command/pictures.h"

#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

#include "core/error.h"
#include "core/rng.h"
#include "io/text_lines.h"

namespace lumicut {

Picture::Picture(int w, int h, Colour background)
    : width(w), height(h), rgb(static_cast<size_t>(w) * static_cast<size_t>(h) * 3) {
  for (size_t i = 0; i < rgb.size(); ++i) rgb[i] = background[i % 3];
}

void Picture::set(int x, int y, Colour c) {
  if (x < 0 || y < 0 || x >= width || y >= height) return;
  std::copy(c.begin(), c.end(), rgb.begin() + 3 * (static_cast<std::ptrdiff_t>(y) * width + x));
}

void Picture::line(double x0, double y0, double x1, double y1, Colour c) {
  const int n = static_cast<int>(std::ceil(std::max({std::fabs(x1 - x0), std::fabs(y1 - y0), 1.0})));
  for (int i = 0; i <= n; ++i) {
    const double t = static_cast<double>(i) / n;
    set(static_cast<int>(std::floor(x0 + (x1 - x0) * t)), static_cast<int>(std::floor(y0 + (y1 - y0) * t)), c);
  }
}

void Picture::dot(double x, double y, double radius, Colour c) {
  for (int j = static_cast<int>(y - radius); j <= static_cast<int>(y + radius); ++j)
    for (int i = static_cast<int>(x - radius); i <= static_cast<int>(x + radius); ++i)
      if ((i - x) * (i - x) + (j - y) * (j - y) <= radius * radius) set(i, j, c);
}

std::string png_of(const Picture& p) {
  std::string out;
  const auto chunk = [&](const char* type, const std::vector<uint8_t>& data) {
    const auto big = [&](uint32_t v) {
      const char b[4] = {static_cast<char>(v >> 24), static_cast<char>(v >> 16), static_cast<char>(v >> 8),
                         static_cast<char>(v)};
      out.append(b, 4);
    };
    big(static_cast<uint32_t>(data.size()));
    out.append(type, 4);
    out.append(data.begin(), data.end());
    uLong crc = crc32(0, reinterpret_cast<const Bytef*>(type), 4);
    if (!data.empty()) crc = crc32(crc, data.data(), static_cast<uInt>(data.size()));
    big(static_cast<uint32_t>(crc));
  };
  out.append("\x89PNG\r\n\x1a\n", 8);
  const auto w = static_cast<uint32_t>(p.width), h = static_cast<uint32_t>(p.height);
  const auto byte = [](uint32_t v, int shift) { return static_cast<uint8_t>(v >> shift); };
  chunk("IHDR", {byte(w, 24), byte(w, 16), byte(w, 8), byte(w, 0), byte(h, 24), byte(h, 16), byte(h, 8), byte(h, 0), 8,
                 2, 0, 0, 0});
  std::vector<uint8_t> rows;
  for (int y = 0; y < p.height; ++y) {
    rows.push_back(0);
    const auto at = p.rgb.begin() + 3 * static_cast<std::ptrdiff_t>(y) * p.width;
    rows.insert(rows.end(), at, at + 3 * p.width);
  }
  uLongf size = compressBound(rows.size());
  std::vector<uint8_t> packed(size);
  if (compress2(packed.data(), &size, rows.data(), rows.size(), 6) != Z_OK)
    throw Error(ErrorCode::internal, "zlib cannot compress a picture");
  packed.resize(size);
  chunk("IDAT", packed);
  chunk("IEND", {});
  return out;
}

Colour label_colour(uint32_t label) {
  const uint64_t h = hash64(label, 12345);
  return {static_cast<uint8_t>(70 + h % 180), static_cast<uint8_t>(70 + (h >> 16) % 180),
          static_cast<uint8_t>(70 + (h >> 32) % 180)};
}

Picture draw_mesh(const FaceMesh& mesh, std::span<const Colour> colours, int width, int height, bool z_up) {
  Picture picture(width, height, {255, 255, 255});
  std::vector<double> depth(static_cast<size_t>(width) * static_cast<size_t>(height),
                            -std::numeric_limits<double>::infinity());
  const Vec3d up = z_up ? Vec3d{0, 0, 1} : Vec3d{0, 1, 0};
  const Vec3d forward = normalize(z_up ? Vec3d{1, 2, 0.5} : Vec3d{1, 0.5, 2});  // towards the eye
  const Vec3d right = normalize(cross(up, forward)), above = cross(forward, right);
  std::vector<Vec3d> v;
  Vec3d lo{1e300, 1e300, 1e300}, hi = -lo;
  for (const Vec3d& p : mesh.vertices) {
    v.push_back({dot(p, right), dot(p, above), dot(p, forward)});
    lo = min(lo, v.back()), hi = max(hi, v.back());
  }
  const double scale = 0.92 * std::min(width / std::max(hi.x - lo.x, 1e-300), height / std::max(hi.y - lo.y, 1e-300));
  for (Vec3d& p : v)
    p = {width / 2.0 + (p.x - (lo.x + hi.x) / 2) * scale, height / 2.0 - (p.y - (lo.y + hi.y) / 2) * scale, p.z};
  for (size_t f = 0; f < mesh.faces.size(); ++f) {
    const Vec3d &a = v[mesh.faces[f][0]], &b = v[mesh.faces[f][1]], &c = v[mesh.faces[f][2]];
    const double area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
    if (area == 0) continue;
    const double shade =
        0.35 + 0.65 * std::fabs(dot(normalize(face_normal_area(mesh, static_cast<uint32_t>(f))), forward));
    Colour colour;
    for (size_t k = 0; k < 3; ++k) colour[k] = static_cast<uint8_t>(colours[f][k] * shade);
    const int x0 = std::max(0, static_cast<int>(std::min({a.x, b.x, c.x}))),
              x1 = std::min(width - 1, static_cast<int>(std::max({a.x, b.x, c.x})));
    const int y0 = std::max(0, static_cast<int>(std::min({a.y, b.y, c.y}))),
              y1 = std::min(height - 1, static_cast<int>(std::max({a.y, b.y, c.y})));
    for (int y = y0; y <= y1; ++y)
      for (int x = x0; x <= x1; ++x) {
        const double px = x + 0.5, py = y + 0.5;
        const double u = ((b.x - px) * (c.y - py) - (b.y - py) * (c.x - px)) / area,
                     w = ((c.x - px) * (a.y - py) - (c.y - py) * (a.x - px)) / area;
        if (u < 0 || w < 0 || u + w > 1) continue;
        const double z = u * a.z + w * b.z + (1 - u - w) * c.z;
        double& nearest = depth[static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x)];
        if (z > nearest) nearest = z, picture.set(x, y, colour);
      }
  }
  return picture;
}

Picture draw_atlas(std::span<const std::array<Point2, 3>> corners, std::span<const Colour> colours, int size) {
  Picture picture(size, size, {255, 255, 255});
  for (size_t f = 0; f < corners.size(); ++f) {
    std::array<Point2, 3> t = corners[f];
    for (Point2& p : t) p = {p.x * size, (1 - p.y) * size};
    const double area = (t[1].x - t[0].x) * (t[2].y - t[0].y) - (t[1].y - t[0].y) * (t[2].x - t[0].x);
    if (area == 0) continue;
    const auto [x0, x1] = std::minmax({t[0].x, t[1].x, t[2].x});
    const auto [y0, y1] = std::minmax({t[0].y, t[1].y, t[2].y});
    for (int y = std::max(0, static_cast<int>(y0)); y <= std::min(size - 1, static_cast<int>(y1)); ++y)
      for (int x = std::max(0, static_cast<int>(x0)); x <= std::min(size - 1, static_cast<int>(x1)); ++x) {
        bool inside = true;
        for (size_t k = 0; k < 3; ++k) {
          const Point2 &a = t[k], &b = t[(k + 1) % 3];
          inside = inside && ((b.x - a.x) * (y + 0.5 - a.y) - (b.y - a.y) * (x + 0.5 - a.x)) * area >= 0;
        }
        if (inside) picture.set(x, y, colours[f]);
      }
  }
  return picture;
}

bool as_svg(const std::string& path) { return io::lower(path).ends_with(".svg"); }

std::string draw_circles(bool svg, std::span<const Point2> points, std::span<const Circle> circles,
                         std::span<const uint32_t> chosen, int size, std::span<const Point2> chain,
                         std::span<const Point2> polygon) {
  Point2 lo{1e300, 1e300}, hi{-1e300, -1e300};
  const auto cover = [&](const Point2& p, double r) {
    lo = {std::min(lo.x, p.x - r), std::min(lo.y, p.y - r)};
    hi = {std::max(hi.x, p.x + r), std::max(hi.y, p.y + r)};
  };
  for (const Point2& p : points) cover(p, 0);
  for (const Circle& c : circles) cover(c.disk.centre, c.disk.radius);
  for (const Point2& p : chain) cover(p, 0);
  if (points.empty() && circles.empty() && chain.empty()) lo = {0, 0}, hi = {1, 1};
  const double scale = (size - 20) / std::max({hi.x - lo.x, hi.y - lo.y, 1e-300});
  const auto x_of = [&](const Point2& p) { return 10 + (p.x - lo.x) * scale; };
  const auto y_of = [&](const Point2& p) { return size - 10 - (p.y - lo.y) * scale; };
  const double dot = std::clamp(0.2 * size / std::sqrt(static_cast<double>(points.size()) + 1), 0.7, 4.0);
  if (svg) {
    std::ostringstream out;
    out << "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"" << size << "\" height=\"" << size
        << "\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n";
    for (const auto& [d, c] : circles)
      out << "<circle cx=\"" << x_of(d.centre) << "\" cy=\"" << y_of(d.centre) << "\" r=\"" << d.radius * scale
          << "\" fill=\"none\" stroke=\"rgb(" << +c[0] << ',' << +c[1] << ',' << +c[2]
          << ")\" stroke-width=\"0.5\"/>\n";
    const auto line = [&](const char* element, std::span<const Point2> through, const char* colour) {
      if (through.empty()) return;
      out << '<' << element << " fill=\"none\" stroke-linejoin=\"round\" stroke=\"" << colour << "\" points=\"";
      for (const Point2& p : through) out << x_of(p) << ',' << y_of(p) << ' ';
      out << "\"/>\n";
    };
    line("polyline", chain, "#7a9ec2"), line("polygon", polygon, "#d02020");
    for (const Point2& p : points)
      out << "<circle cx=\"" << x_of(p) << "\" cy=\"" << y_of(p) << "\" r=\"" << dot << "\" fill=\"#909090\"/>\n";
    for (const uint32_t i : chosen)
      out << "<circle cx=\"" << x_of(points[i]) << "\" cy=\"" << y_of(points[i]) << "\" r=\"" << 1.6 * dot
          << "\" fill=\"#d02020\"/>\n";
    out << "</svg>\n";
    return std::move(out).str();
  }
  Picture picture(size, size, {255, 255, 255});
  for (const auto& [d, c] : circles) {
    const int n = std::clamp(static_cast<int>(d.radius * scale * 7), 8, 40000);
    for (int k = 0; k < n; ++k) {
      const double t = 6.283185307179586 * k / n;
      picture.set(static_cast<int>(x_of(d.centre) + d.radius * scale * std::cos(t)),
                  static_cast<int>(y_of(d.centre) + d.radius * scale * std::sin(t)), c);
    }
  }
  for (size_t i = 1; i < chain.size(); ++i)
    picture.line(x_of(chain[i - 1]), y_of(chain[i - 1]), x_of(chain[i]), y_of(chain[i]), {122, 158, 194});
  for (size_t i = 0; i < polygon.size(); ++i) {
    const Point2 &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
    picture.line(x_of(a), y_of(a), x_of(b), y_of(b), {208, 32, 32});
  }
  for (const Point2& p : points) picture.dot(x_of(p), y_of(p), dot, {144, 144, 144});
  for (const uint32_t i : chosen) picture.dot(x_of(points[i]), y_of(points[i]), 1.6 * dot, {208, 32, 32});
  return png_of(picture);
}

std::string draw_hitting_set(bool svg, std::span<const Point2> points, std::span<const Disk> disks,
                             std::span<const uint32_t> chosen, int size) {
  std::vector<Circle> circles;
  for (const Disk& d : disks) circles.push_back({d, {122, 158, 194}});
  return draw_circles(svg, points, circles, chosen, size);
}

}  // namespace lumicut
