// Pictures of the geometry command: PNG files, a small rasteriser, hitting-set instances.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "geometry/face_mesh.h"
#include "geometry/point2.h"

namespace lumicut {

using Colour = std::array<uint8_t, 3>;

struct Picture {
  int width, height;
  std::vector<uint8_t> rgb;
  Picture(int w, int h, Colour background);
  void set(int x, int y, Colour c);
  void line(double x0, double y0, double x1, double y1, Colour c);
  void dot(double x, double y, double radius, Colour c);
};

// The bytes of a PNG.
std::string png_of(const Picture& picture);

// Colours that differ for neighbouring numbers.
Colour label_colour(uint32_t label);

// The mesh from (1, .5, 2) of its box, z or y up, flat-shaded with a colour a face.
Picture draw_mesh(const FaceMesh& mesh, std::span<const Colour> face_colours, int width, int height, bool z_up);

// An atlas: the charts' triangles with a colour a face, on white. [geometry/texture_atlas.h]
Picture draw_atlas(std::span<const std::array<Point2, 3>> corners, std::span<const Colour> face_colours, int size);

// Whether a file of this name holds SVG, which it does where it ends so; else PNG.
bool as_svg(const std::string& path);

struct Circle {
  Disk disk;
  Colour colour;
};
// Circles as outlines, points grey, chosen points red: the bytes of an SVG or of a PNG.
// `chain`: an open line through points, grey; `polygon`: a closed one, red. Either may be empty.
std::string draw_circles(bool svg, std::span<const Point2> points, std::span<const Circle> circles,
                         std::span<const uint32_t> chosen, int size, std::span<const Point2> chain = {},
                         std::span<const Point2> polygon = {});
// The same of an instance: its disks in blue.
std::string draw_hitting_set(bool svg, std::span<const Point2> points, std::span<const Disk> disks,
                             std::span<const uint32_t> chosen, int size);

}  // namespace lumicut
