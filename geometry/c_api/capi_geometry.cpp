// lumicut_geometry.h, but for what needs CGAL.
#include <algorithm>
#include <limits>
#include <memory>

#include "accel/agglomerate.h"
#include "geometry/balltree.h"
#include "geometry/c_api/api.h"
#include "geometry/dynamic_hull.h"
#include "geometry/face_cluster_tree.h"
#include "geometry/face_kmeans.h"
#include "geometry/hitting_set.h"
#include "geometry/independent_set.h"
#include "geometry/instances.h"
#include "geometry/texture_atlas.h"

using namespace lumicut;
using namespace lumicut::c_api;

namespace {

// No allocation where there is no memory for one.
thread_local char last_error[512] = "";

FaceMesh mesh_of(const double* vertices, size_t vertex_count, const uint32_t* faces, size_t face_count) {
  const auto v = array(vertices, vertex_count, 3, "vertices");
  const auto f = array(faces, face_count, 3, "faces");
  FaceMesh mesh;
  mesh.vertices.reserve(vertex_count), mesh.faces.reserve(face_count);
  for (size_t i = 0; i < vertex_count; ++i) mesh.vertices.push_back({v[3 * i], v[3 * i + 1], v[3 * i + 2]});
  for (size_t i = 0; i < face_count; ++i) mesh.faces.push_back({f[3 * i], f[3 * i + 1], f[3 * i + 2]});
  validate_mesh(mesh);
  return mesh;
}

std::vector<Aabb> boxes_of(std::span<const float> items) {
  std::vector<Aabb> boxes(items.size() / 6);
  for (size_t i = 0; i < boxes.size(); ++i)
    for (int axis = 0; axis < 3; ++axis) {
      const float lo = items[6 * i + static_cast<size_t>(axis)], hi = items[6 * i + 3 + static_cast<size_t>(axis)];
      if (!(std::fabs(lo) < 1e19f && std::fabs(hi) < 1e19f && lo <= hi))
        fail_argument("box " + std::to_string(i) + ": its corners are not finite, beyond 1e19 or the wrong way round");
      boxes[i].lo[axis] = lo, boxes[i].hi[axis] = hi;
    }
  return boxes;
}

void check_exchange(int exchange) {
  if (exchange < 2 || exchange > 4) fail_argument("exchange " + std::to_string(exchange) + " is not in 2 to 4");
}

}  // namespace

struct lumicut_indices_t {
  std::vector<uint32_t> indices;
};
struct lumicut_balltree_t {
  BallTree tree;
};
struct lumicut_hull_t {
  DynamicHull hull;
};
struct lumicut_face_clusters_t {
  FaceKmeans clusters;
};
struct lumicut_face_tree_t {
  FaceMesh mesh;
  FaceClusterTree tree;
};

extern "C" {

const char* lumicut_geometry_error() { return last_error; }

const char* lumicut_geometry_version() { return LUMICUT_VERSION_TEXT; }

int lumicut_geometry_fail(int code, const char* text) {
  std::snprintf(last_error, sizeof last_error, "%s", text == nullptr ? "" : text);
  return code;
}

size_t lumicut_indices_count(lumicut_indices list) { return list == nullptr ? 0 : list->indices.size(); }
const uint32_t* lumicut_indices_data(lumicut_indices list) { return list == nullptr ? nullptr : list->indices.data(); }
void lumicut_indices_release(lumicut_indices list) { delete list; }
int lumicut_indices_create(const uint32_t* indices, size_t count, lumicut_indices* list) {
  return guard([&] {
    const auto from = array(indices, count, 1, "indices");
    required(list, "list") = new lumicut_indices_t{{from.begin(), from.end()}};
  });
}

int lumicut_agglomerate(const float* items, size_t count, int dimension, int strategy, uint32_t* merges, float* costs) {
  return guard([&] {
    if (strategy < 0 || strategy > LUMICUT_AGGLOMERATE_PARALLEL)
      fail_argument("strategy " + std::to_string(strategy) + " is not in 0 to 3");
    if (dimension < 0 || dimension > 16) fail_argument("dimension " + std::to_string(dimension) + " is not in 0 to 16");
    if (count >= uint64_t{1} << 31) fail_argument("items: " + std::to_string(count) + " are 2147483648 or more");
    const auto by = static_cast<Strategy>(strategy);
    const auto width = static_cast<size_t>(dimension == 0 ? 6 : dimension + 1);
    const auto values = array(items, count, width, "items");
    std::vector<Merge> list;
    if (dimension == 0) {
      std::vector<Aabb> boxes = boxes_of(values);
      list = agglomerate_boxes(boxes, by);
      for (Merge& m : list) {  // in the caller's units
        Aabb joint = boxes[m.left];
        joint.extend(boxes[m.right]);
        m.cost = joint.half_area();
        boxes.push_back(joint);
      }
    } else {
      std::vector<float> centres, radii;
      for (size_t i = 0; i < count; ++i) {
        const auto row = values.subspan(i * width, width);
        centres.insert(centres.end(), row.begin(), row.end() - 1);
        radii.push_back(row.back());
      }
      list = agglomerate_balls(centres, radii, dimension, by);
    }
    if (!list.empty()) required(merges, "merges");
    for (size_t i = 0; i < list.size(); ++i) {
      merges[2 * i] = list[i].left, merges[2 * i + 1] = list[i].right;
      if (costs != nullptr) costs[i] = list[i].cost;
    }
  });
}

int lumicut_agglomerate_by(const lumicut_dissimilarity* dissimilarity, const float* leaves, size_t count, int strategy,
                           uint32_t* merges, float* costs) {
  return guard([&] {
    const lumicut_dissimilarity& d = required(dissimilarity, "dissimilarity");
    if (d.struct_size != sizeof(lumicut_dissimilarity))
      fail_argument("lumicut_dissimilarity.struct_size is " + std::to_string(d.struct_size) + ", not " +
                    std::to_string(sizeof(lumicut_dissimilarity)));
    if (strategy < 0 || strategy > LUMICUT_AGGLOMERATE_PARALLEL)
      fail_argument("strategy " + std::to_string(strategy) + " is not in 0 to 3");
    if (d.may_decrease > 1)
      fail_argument("lumicut_dissimilarity.may_decrease is " + std::to_string(d.may_decrease) + ", not 0 or 1");
    required(d.merge, "merge"), required(d.cost, "cost");
    Dissimilarity by;
    by.features = d.features, by.key_features = d.key_features, by.non_decreasing = d.may_decrease == 0;
    by.merge = [&d](const float* a, const float* b, float* joint) { d.merge(d.user, a, b, joint); };
    by.cost = [&d](const float* a, const float* others, size_t n, float* out) { d.cost(d.user, a, others, n, out); };
    if (d.order != nullptr) by.order = [&d](const float* a, float* point) { d.order(d.user, a, point); };
    const auto list = agglomerate_by(by, array(leaves, count, d.features, "leaves"), static_cast<Strategy>(strategy));
    if (!list.empty()) required(merges, "merges");
    for (const Merge& m : list) {
      *merges++ = m.left, *merges++ = m.right;
      if (costs != nullptr) *costs++ = m.cost;
    }
  });
}

int lumicut_balltree_create(const double* centres, const double* radii, size_t count, int dimension, int builder,
                            lumicut_balltree* tree) {
  return guard([&] {
    required(tree, "tree");
    if (builder < 0 || builder > LUMICUT_BALLTREE_BOTTOM_UP)
      fail_argument("builder " + std::to_string(builder) + " is not in 0 to 4");
    if (dimension < 1 || dimension > 1024)
      fail_argument("dimension " + std::to_string(dimension) + " is not in 1 to 1024");
    const auto c = array(centres, count, static_cast<size_t>(dimension), "centres");
    const std::span<const double> r(radii, radii == nullptr ? 0 : count);
    *tree = new lumicut_balltree_t{BallTree::build(c, r, dimension, static_cast<BallTreeBuilder>(builder))};
  });
}

void lumicut_balltree_release(lumicut_balltree tree) { delete tree; }

int lumicut_balltree_insert(lumicut_balltree tree, const double* centre, double radius, int cheap, uint32_t* leaf) {
  return guard([&] {
    BallTree& t = required(tree, "tree").tree;
    const uint32_t made = t.insert(array(centre, 1, static_cast<size_t>(t.dimension()), "centre"), radius, cheap != 0);
    if (leaf != nullptr) *leaf = made;
  });
}

int lumicut_balltree_remove(lumicut_balltree tree, uint32_t leaf) {
  return guard([&] { required(tree, "tree").tree.remove(leaf); });
}

int lumicut_balltree_measure(lumicut_balltree tree, size_t* leaves, double* volume, size_t* depth) {
  return guard([&] {
    const BallTree& t = required(tree, "tree").tree;
    if (leaves != nullptr) *leaves = t.size();
    if (volume != nullptr) *volume = t.total_volume();
    if (depth != nullptr) *depth = t.depth();
  });
}

int lumicut_balltree_search(lumicut_balltree tree, int kind, const double* centres, const double* radii, size_t count,
                            size_t* offsets, lumicut_indices* found) {
  return guard([&] {
    const BallTree& t = required(tree, "tree").tree;
    required(offsets, "offsets"), required(found, "found");
    if (kind < 0 || kind > LUMICUT_BALLTREE_CONTAINED)
      fail_argument("kind " + std::to_string(kind) + " is not in 0 to 2");
    const auto width = static_cast<size_t>(t.dimension());
    const auto c = array(centres, count, width, "centres");
    std::vector<uint32_t> all;
    std::vector<size_t> ends{0};
    for (size_t q = 0; q < count; ++q) {
      const auto centre = c.subspan(q * width, width);
      const double radius = radii == nullptr ? 0.0 : radii[q];
      const auto one = kind == LUMICUT_BALLTREE_CONTAINING     ? t.containing(centre, radius)
                       : kind == LUMICUT_BALLTREE_INTERSECTING ? t.intersecting(centre, radius)
                                                               : t.contained(centre, radius);
      all.insert(all.end(), one.begin(), one.end());
      ends.push_back(all.size());
    }
    give(all, found, "found");
    std::copy(ends.begin(), ends.end(), offsets);
  });
}

int lumicut_balltree_nearest(lumicut_balltree tree, const double* points, size_t count, size_t nearest,
                             uint32_t* leaves) {
  return lumicut_balltree_nearest_by(tree, 0, points, count, nearest, leaves);
}

int lumicut_balltree_best_mate(lumicut_balltree tree, const double* centres, const double* radii, size_t count,
                               uint32_t* leaves) {
  return guard([&] {
    const BallTree& t = required(tree, "tree").tree;
    const auto width = static_cast<size_t>(t.dimension());
    const auto c = array(centres, count, width, "centres");
    if (count != 0) required(leaves, "leaves");
    for (size_t q = 0; q < count; ++q)
      leaves[q] = t.best_mate(c.subspan(q * width, width), radii == nullptr ? 0.0 : radii[q]);
  });
}

int lumicut_balltree_nearest_by(lumicut_balltree tree, int by, const double* points, size_t count, size_t nearest,
                                uint32_t* leaves) {
  return guard([&] {
    if (by < 0 || by > 2) fail_argument("by " + std::to_string(by) + " is not in 0 to 2");
    const BallTree& t = required(tree, "tree").tree;
    const auto width = static_cast<size_t>(t.dimension());
    const auto p = array(points, count, width, "points");
    if (count != 0 && nearest != 0) required(leaves, "leaves");
    std::vector<uint32_t> all;
    for (size_t q = 0; q < count; ++q) {
      const auto one = t.nearest(p.subspan(q * width, width), nearest, static_cast<BallTree::Distance>(by));
      all.insert(all.end(), one.begin(), one.end());
      all.resize((q + 1) * nearest, LUMICUT_GEOMETRY_NONE);
    }
    std::copy(all.begin(), all.end(), leaves);
  });
}

int lumicut_hull_create(int check_simple, lumicut_hull* hull) {
  return guard([&] { required(hull, "hull") = new lumicut_hull_t{DynamicHull({.check_simple = check_simple != 0})}; });
}

void lumicut_hull_release(lumicut_hull hull) { delete hull; }

int lumicut_hull_push(lumicut_hull hull, const double* points, size_t count) {
  return guard([&] {
    DynamicHull& h = required(hull, "hull").hull;
    const auto all = points_of(points, count);
    for (size_t i = 0; i < count; ++i) try {
        h.push_front(all[i]);
      } catch (const Error& e) {
        throw Error(e.code(), "point " + std::to_string(i) + ": " + e.what());
      }
  });
}

int lumicut_hull_pop(lumicut_hull hull, size_t count) {
  return guard([&] {
    DynamicHull& h = required(hull, "hull").hull;
    if (count > h.size())
      fail_state("hull: " + std::to_string(count) + " points to remove of " + std::to_string(h.size()));
    for (size_t i = 0; i < count; ++i) h.pop_back();
  });
}

int lumicut_hull_size(lumicut_hull hull, size_t* points, size_t* vertices) {
  return guard([&] {
    const DynamicHull& h = required(hull, "hull").hull;
    if (points != nullptr) *points = h.size();
    if (vertices != nullptr) *vertices = h.hull_size();
  });
}

int lumicut_hull_vertices(lumicut_hull hull, double* vertices) {
  return guard([&] {
    const DynamicHull& h = required(hull, "hull").hull;
    if (!h.empty()) required(vertices, "vertices");
    h.for_each_hull_vertex([&](const Point2& p) { *vertices++ = p.x, *vertices++ = p.y; });
  });
}

int lumicut_hitting_set(const double* points, size_t point_count, const double* disks, size_t disk_count,
                        int drop_empty, lumicut_indices* chosen, lumicut_hitting_set_info* info) {
  return guard([&] {
    HittingSetOptions o;
    o.drop_empty_disks = drop_empty != 0;
    const HittingSet h = solve_hitting_set(points_of(points, point_count), disks_of(disks, disk_count), o);
    give(h.points, chosen, "chosen");
    if (info != nullptr) *info = {h.lower_bound, h.empty_disks, h.greedy};
  });
}

int lumicut_hitting_set_greedy(const double* points, size_t point_count, const double* disks, size_t disk_count,
                               int pruned, lumicut_indices* chosen) {
  return guard([&] {
    give(greedy_hitting_set(points_of(points, point_count), disks_of(disks, disk_count), pruned != 0), chosen,
         "chosen");
  });
}

int lumicut_hitting_set_improve(const double* points, size_t point_count, const double* disks, size_t disk_count,
                                const uint32_t* start, size_t start_count, int exchange, lumicut_indices* chosen) {
  return guard([&] {
    check_exchange(exchange);
    const auto from = array(start, start_count, 1, "start");
    for (const uint32_t i : from)
      if (i >= point_count)
        fail_argument("start: " + std::to_string(i) + " is of none of " + std::to_string(point_count) + " points");
    give(improve_hitting_set(points_of(points, point_count), disks_of(disks, disk_count), from, exchange), chosen,
         "chosen");
  });
}

int lumicut_hitting_set_of_ranges(size_t point_count, const size_t* offsets, const uint32_t* members,
                                  size_t range_count, int drop_empty, const uint32_t* start, size_t start_count,
                                  int exchange, lumicut_indices* chosen, lumicut_hitting_set_info* info) {
  return guard([&] {
    if (exchange != 0) check_exchange(exchange);
    if (point_count >= LUMICUT_GEOMETRY_NONE)
      fail_argument("point_count " + std::to_string(point_count) + " is too many");
    required(offsets, "offsets");
    const std::span<const size_t> ends = {offsets, array(offsets, range_count, 1, "offsets").size() + 1};
    const auto list = array(members, ends.back(), 1, "members");
    if (exchange != 0) {
      give(improve_hitting_set(point_count, ends, list, array(start, start_count, 1, "start"), exchange), chosen,
           "chosen");
      return;
    }
    HittingSetOptions o;
    o.drop_empty_disks = drop_empty != 0;
    const HittingSet h = solve_hitting_set(point_count, ends, list, o);
    give(h.points, chosen, "chosen");
    if (info != nullptr) *info = {h.lower_bound, h.empty_disks, h.greedy};
  });
}

int lumicut_points_in_copies(const double* points, size_t point_count, const double* shape, size_t corner_count,
                             const double* copies, size_t copy_count, size_t* offsets, lumicut_indices* members) {
  return guard([&] {
    array(shape, corner_count, 2, "shape"), array(copies, copy_count, 3, "copies"), required(offsets, "offsets");
    const Ranges ranges =
        points_in_copies(points_of(points, point_count), points_of(shape, corner_count), disks_of(copies, copy_count));
    give(ranges.members, members, "members");
    std::copy(ranges.offsets.begin(), ranges.offsets.end(), offsets);
  });
}

int lumicut_tight_instance(int side, double* points, double* disks) {
  return guard([&] {
    required(points, "points"), required(disks, "disks");
    const TightInstance t = tight_instance(side);
    for (const Point2& p : t.points) *points++ = p.x, *points++ = p.y;
    for (const Disk& d : t.disks) *disks++ = d.centre.x, *disks++ = d.centre.y, *disks++ = d.radius;
  });
}

int lumicut_independent_disks(const double* disks, size_t disk_count, int exchange, const uint32_t* start,
                              size_t start_count, lumicut_indices* chosen) {
  return guard([&] {
    check_exchange(exchange);
    give(independent_disks(disks_of(disks, disk_count), exchange, array(start, start_count, 1, "start")), chosen,
         "chosen");
  });
}

int lumicut_face_clusters_create(const double* vertices, size_t vertex_count, const uint32_t* faces, size_t face_count,
                                 const lumicut_face_clusters_desc* desc, lumicut_face_clusters* clusters) {
  return guard([&] {
    required(clusters, "clusters");
    FaceKmeansOptions o;
    if (desc != nullptr) {
      if (desc->struct_size != sizeof(lumicut_face_clusters_desc))
        fail_argument("lumicut_face_clusters_desc.struct_size is " + std::to_string(desc->struct_size) + ", not " +
                      std::to_string(sizeof(lumicut_face_clusters_desc)));
      if (desc->clusters != 0) o.clusters = desc->clusters;
      if (!(desc->lambda < 0)) o.lambda = desc->lambda;
      if (!(desc->geodesic < 0)) o.geodesic = desc->geodesic;
      if (desc->metric > 1) fail_argument("lumicut_face_clusters_desc.metric is " + std::to_string(desc->metric));
      if (desc->random > 1) fail_argument("lumicut_face_clusters_desc.random is " + std::to_string(desc->random));
      if (desc->metric == 1) o.metric = FaceKmeansOptions::Metric::schlafman;
      o.random_seeds = desc->random == 1, o.seed = desc->seed;
    }
    *clusters = new lumicut_face_clusters_t{FaceKmeans(mesh_of(vertices, vertex_count, faces, face_count), o)};
  });
}

void lumicut_face_clusters_release(lumicut_face_clusters clusters) { delete clusters; }

int lumicut_face_clusters_run(lumicut_face_clusters clusters, size_t limit, size_t* iterations) {
  return guard([&] {
    const size_t made = required(clusters, "clusters").clusters.run(limit);
    if (iterations != nullptr) *iterations = made;
  });
}

int lumicut_face_clusters_move(lumicut_face_clusters clusters, const double* vertices) {
  return guard([&] {
    FaceKmeans& k = required(clusters, "clusters").clusters;
    const auto v = array(vertices, k.mesh().vertices.size(), 3, "vertices");
    std::vector<Vec3d> places;
    for (size_t i = 0; i < v.size(); i += 3) places.push_back({v[i], v[i + 1], v[i + 2]});
    k.move(places);
  });
}

int lumicut_face_clusters_refine(lumicut_face_clusters clusters, double error, size_t most) {
  return guard([&] {
    FaceKmeans& k = required(clusters, "clusters").clusters;
    if (!std::isfinite(error) || error < 0)
      fail_argument("error " + std::to_string(error) + " is not finite or below 0");
    k.refine(error, most);
  });
}

int lumicut_face_clusters_read(lumicut_face_clusters clusters, uint32_t* labels, size_t* count, double* error) {
  return guard([&] {
    const FaceKmeans& k = required(clusters, "clusters").clusters;
    if (labels != nullptr) std::copy(k.labels().begin(), k.labels().end(), labels);
    if (count != nullptr) *count = k.cluster_count();
    if (error != nullptr) *error = k.error();
  });
}

int lumicut_face_tree_create(const double* vertices, size_t vertex_count, const uint32_t* faces, size_t face_count,
                             const double* weights, lumicut_face_tree* tree) {
  return guard([&] {
    required(tree, "tree");
    FaceMesh mesh = mesh_of(vertices, vertex_count, faces, face_count);
    FaceClusterTree made(mesh, {weights, weights == nullptr ? 0 : face_count});
    *tree = new lumicut_face_tree_t{std::move(mesh), std::move(made)};
  });
}

void lumicut_face_tree_release(lumicut_face_tree tree) { delete tree; }

int lumicut_face_tree_set_weights(lumicut_face_tree tree, const double* weights) {
  return guard([&] {
    auto& t = required(tree, "tree");
    t.tree.set_weights(array(weights, t.mesh.faces.size(), 1, "weights"));
  });
}

int lumicut_face_tree_set_weight(lumicut_face_tree tree, uint32_t face, double weight) {
  return guard([&] { required(tree, "tree").tree.set_weight(face, weight); });
}

int lumicut_texture_atlas(const double* vertices, size_t vertex_count, const uint32_t* faces, size_t face_count,
                          const uint32_t* labels, double gap, double* corners, size_t* turned_away) {
  return guard([&] {
    const FaceMesh mesh = mesh_of(vertices, vertex_count, faces, face_count);
    const TextureAtlas atlas = make_texture_atlas(mesh, array(labels, face_count, 1, "labels"), gap);
    if (face_count != 0) required(corners, "corners");
    for (const auto& face : atlas.corners)
      for (const Point2& p : face) *corners++ = p.x, *corners++ = p.y;
    if (turned_away != nullptr) *turned_away = atlas.turned_away;
  });
}

int lumicut_face_tree_read(lumicut_face_tree tree, int level, uint32_t* labels, double* imbalance) {
  return guard([&] {
    const auto& t = required(tree, "tree");
    if (level < 0) fail_argument("level " + std::to_string(level) + " is below 0");
    if (labels != nullptr) {
      const auto found = t.tree.labels_at_level(level);
      std::copy(found.begin(), found.end(), labels);
    }
    if (imbalance != nullptr) *imbalance = t.tree.mean_imbalance(false);
  });
}

}  // extern "C"
