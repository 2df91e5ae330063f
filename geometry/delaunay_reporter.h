// Points in disks, and disks without a point of a set, by Delaunay triangulations. [Bus 2015 (thesis), Lemmas 7.2, 7.3]
//
// Target lumicut_geometry_cgal. For a disk that holds no point of a net: its centre's nearest net point, of that the two
// neighbouring Delaunay disks whose centres lie before and after the disk's centre around it (by binary search), and of
// those the points, which are listed. The two disks cover the one asked for.
// Completes the thesis: at the net's hull the outer half-planes of hull edges are Delaunay disks too, in the place of
// their outward normals; and where rounding leaves open which two disks it is, their neighbours are looked through too.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "geometry/point2.h"

namespace lumicut {

class DelaunayReporter {
 public:
  // `points` stay where they are. O(n) memory where Delaunay disks of the net hold few points each.
  DelaunayReporter(std::span<const Point2> points, std::span<const uint32_t> net);
  ~DelaunayReporter();

  // Appends the points in a disk that holds none of the net, ascending. (Of other disks: some of their points.)
  void report(const Disk& disk, std::vector<uint32_t>& found) const;
  // Points in all lists together.
  size_t listed() const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

// Whether a disk holds a point of a set that grows: by its centre's nearest one.
class DelaunayNearest {
 public:
  explicit DelaunayNearest(std::span<const Point2> points);
  DelaunayNearest(DelaunayNearest&&) noexcept;
  ~DelaunayNearest();
  void insert(uint32_t point);
  bool hit(const Disk& disk) const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace lumicut
