#include "geometry/texture_atlas.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>

#include "core/error.h"

namespace lumicut {
namespace {

struct Chart {
  std::vector<uint32_t> faces;
  Vec3d right, up;  // of its plane
  Point2 lo, size;  // its box there
};

// Turns a chart's plane to the least of the boxes at 32 angles, the longer side along x.
void fit(const FaceMesh& mesh, Chart& c) {
  const Vec3d a = c.right, b = c.up;
  double least = -1;
  for (int k = 0; k < 32; ++k) {
    const double t = 3.141592653589793 * k / 32;
    const Vec3d right = a * std::cos(t) + b * std::sin(t), up = b * std::cos(t) - a * std::sin(t);
    Point2 lo{1e300, 1e300}, hi{-1e300, -1e300};
    for (const uint32_t f : c.faces)
      for (const uint32_t v : mesh.faces[f]) {
        const double x = dot(mesh.vertices[v], right), y = dot(mesh.vertices[v], up);
        lo = {std::min(lo.x, x), std::min(lo.y, y)}, hi = {std::max(hi.x, x), std::max(hi.y, y)};
      }
    const Point2 size{hi.x - lo.x, hi.y - lo.y};
    if (size.y > size.x || (least >= 0 && size.x * size.y >= least)) continue;
    least = size.x * size.y;
    c.right = right, c.up = up, c.lo = lo, c.size = size;
  }
}

// Rows of a width, highest charts first: the height. `at`: where charts begin.
double pack(std::span<const Chart> charts, std::span<const uint32_t> order, double width, double gap,
            std::vector<Point2>* at) {
  double x = 0, y = 0, row = 0;
  for (const uint32_t i : order) {
    const Point2& size = charts[i].size;
    if (x > 0 && x + size.x > width) x = 0, y += row + gap, row = 0;
    if (at) (*at)[i] = {x, y};
    x += size.x + gap;
    row = std::max(row, size.y);
  }
  return y + row;
}

}  // namespace

TextureAtlas make_texture_atlas(const FaceMesh& mesh, std::span<const uint32_t> labels, double gap) {
  validate_mesh(mesh);
  if (labels.size() != mesh.faces.size())
    fail_argument("texture atlas: " + std::to_string(labels.size()) + " labels for " +
                  std::to_string(mesh.faces.size()) + " faces");
  if (!(gap >= 0 && gap <= 0.1)) fail_argument("texture atlas: gap is " + std::to_string(gap) + ", not in [0, .1]");
  TextureAtlas atlas;
  atlas.corners.resize(labels.size());
  std::vector<uint32_t> order(labels.size());
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) { return labels[a] < labels[b]; });
  std::vector<Chart> charts;
  for (size_t i = 0; i < order.size(); ++i) {
    if (i == 0 || labels[order[i]] != labels[order[i - 1]]) charts.emplace_back();
    charts.back().faces.push_back(order[i]);
  }
  double area = 0, flat = 0, widest = 0;
  for (Chart& c : charts) {
    Vec3d normal;
    for (const uint32_t f : c.faces) normal += face_normal_area(mesh, f);
    if (length2(normal) == 0) normal = {0, 0, 1};
    normal = normalize(normal);
    c.right = normalize(cross(std::fabs(normal.x) < 0.7 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0}, normal));
    c.up = cross(normal, c.right);
    fit(mesh, c);
    widest = std::max(widest, c.size.x);
    for (const uint32_t f : c.faces) {
      const Vec3d n = face_normal_area(mesh, f);
      area += length(n), flat += std::fabs(dot(n, normal));
      atlas.turned_away += dot(n, normal) < 0;
    }
  }
  atlas.charts = charts.size();
  if (charts.empty()) return atlas;
  std::vector<uint32_t> by_height(charts.size());
  std::iota(by_height.begin(), by_height.end(), 0u);
  std::stable_sort(by_height.begin(), by_height.end(),
                   [&](uint32_t a, uint32_t b) { return charts[a].size.y > charts[b].size.y; });
  // The width that gives the least square, of a few; the gap is a share of that square.
  double side = 0, best_width = 0, space = 0;
  double boxes = 0;
  for (const Chart& c : charts) boxes += c.size.x * c.size.y;
  const double guess = std::max(widest, std::sqrt(boxes));
  for (int k = 0; k < 24; ++k) {
    const double width = std::max(widest, guess * (0.9 + 0.05 * k));
    double now = width;
    for (int i = 0; i < 8; ++i) now = std::max(width, pack(charts, by_height, width, gap * now, nullptr));
    // Rows grow with the gap: once more, with what it is measured by.
    const double g = gap * now, height = pack(charts, by_height, width, g, nullptr), square = std::max(width, height);
    if (side == 0 || square < side) side = square, best_width = width, space = g;
  }
  if (side == 0) side = 1;  // points alone
  std::vector<Point2> at(charts.size());
  pack(charts, by_height, best_width, space, &at);
  for (size_t i = 0; i < charts.size(); ++i)
    for (const uint32_t f : charts[i].faces)
      for (size_t k = 0; k < 3; ++k) {
        const Vec3d& v = mesh.vertices[mesh.faces[f][k]];
        atlas.corners[f][k] = {std::clamp((at[i].x + dot(v, charts[i].right) - charts[i].lo.x) / side, 0.0, 1.0),
                               std::clamp((at[i].y + dot(v, charts[i].up) - charts[i].lo.y) / side, 0.0, 1.0)};
      }
  atlas.scale = 1 / side;
  atlas.used = 0.5 * flat / (side * side);
  atlas.shrink = area > 0 ? 1 - flat / area : 0;
  return atlas;
}

std::string obj_of(const FaceMesh& mesh, const TextureAtlas& atlas) {
  std::string text;
  char line[160];
  for (const Vec3d& v : mesh.vertices) {
    std::snprintf(line, sizeof line, "v %.9g %.9g %.9g\n", v.x, v.y, v.z);
    text += line;
  }
  for (const auto& face : atlas.corners)
    for (const Point2& p : face) {
      std::snprintf(line, sizeof line, "vt %.9g %.9g\n", p.x, p.y);
      text += line;
    }
  for (size_t f = 0; f < mesh.faces.size(); ++f) {
    const auto& v = mesh.faces[f];
    std::snprintf(line, sizeof line, "f %u/%zu %u/%zu %u/%zu\n", v[0] + 1, 3 * f + 1, v[1] + 1, 3 * f + 2, v[2] + 1,
                  3 * f + 3);
    text += line;
  }
  return text;
}

std::vector<ClusterBox> cluster_boxes(const FaceMesh& mesh, std::span<const uint32_t> labels) {
  if (labels.size() != mesh.faces.size())
    fail_argument("boxes: " + std::to_string(labels.size()) + " labels for " + std::to_string(mesh.faces.size()) +
                  " faces");
  for (size_t f = 0; f < labels.size(); ++f)
    if (labels[f] >= labels.size())
      fail_argument("boxes: label " + std::to_string(labels[f]) + " of face " + std::to_string(f) + " of " +
                    std::to_string(labels.size()));
  const uint32_t count = labels.empty() ? 0 : *std::max_element(labels.begin(), labels.end()) + 1;
  constexpr double kFar = 1e300;
  std::vector<ClusterBox> boxes(count, {0, {kFar, kFar, kFar}, {-kFar, -kFar, -kFar}});
  for (size_t f = 0; f < labels.size(); ++f) {
    ClusterBox& box = boxes[labels[f]];
    box.label = labels[f];
    for (const uint32_t v : mesh.faces[f])
      box.lo = min(box.lo, mesh.vertices[v]), box.hi = max(box.hi, mesh.vertices[v]);
  }
  std::erase_if(boxes, [](const ClusterBox& b) { return b.lo.x > b.hi.x; });
  return boxes;
}

}  // namespace lumicut
