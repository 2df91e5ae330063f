/* SPDX-License-Identifier: Apache-2.0
   The geometry of the papers from C: ball trees, hulls of sliding windows, hitting sets, epsilon-nets, face clusters,
   agglomeration. Library liblumicut_geometry; the three functions at the end are in liblumicut_geometry_cgal, which has parts of
   CGAL in it and is under the GPL.

   Points in the plane are x, y; disks x, y, radius, and closed; all arrays are dense. Every function that may fail returns a
   code, and lumicut_geometry_error() says what was wrong; nothing is changed then, and what it would have returned is not
   written. Objects may be used by one thread at a time, different ones by different threads. Handles that are NULL are
   refused; releasing NULL does nothing. */
#ifndef LUMICUT_GEOMETRY_H_
#define LUMICUT_GEOMETRY_H_

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#if defined(LUMICUT_GEOMETRY_BUILDING)
#define LUMICUT_GEOMETRY_API __attribute__((visibility("default")))
#else
#define LUMICUT_GEOMETRY_API
#endif

/* Codes: those of lumicut_result in lumicut.h. */
enum {
  LUMICUT_GEOMETRY_OK = 0,
  LUMICUT_GEOMETRY_INVALID_ARGUMENT = 1,
  LUMICUT_GEOMETRY_INVALID_STATE = 2,
  LUMICUT_GEOMETRY_OUT_OF_MEMORY = 4,
  LUMICUT_GEOMETRY_INTERNAL = 6
};
#define LUMICUT_GEOMETRY_NONE 0xffffffffu /* no index */

/* Of the last call in this thread that failed; never NULL. */
LUMICUT_GEOMETRY_API const char* lumicut_geometry_error(void);
LUMICUT_GEOMETRY_API const char* lumicut_geometry_version(void); /* "1.4.0" */

/* ---- Lists of indices that functions return ---- */
typedef struct lumicut_indices_t* lumicut_indices;
LUMICUT_GEOMETRY_API size_t lumicut_indices_count(lumicut_indices list);
LUMICUT_GEOMETRY_API const uint32_t* lumicut_indices_data(lumicut_indices list); /* until it is released */
LUMICUT_GEOMETRY_API void lumicut_indices_release(lumicut_indices list);
/* For libraries that stand on this one: a list that is a copy, and what lumicut_geometry_error() says next; returns `code`. */
LUMICUT_GEOMETRY_API int lumicut_indices_create(const uint32_t* indices, size_t count, lumicut_indices* list);
LUMICUT_GEOMETRY_API int lumicut_geometry_fail(int code, const char* text);

/* ---- Agglomeration [Walter et al. 2008] ---- */
enum {
  LUMICUT_AGGLOMERATE_NAIVE = 0,
  LUMICUT_AGGLOMERATE_HEAP = 1,
  LUMICUT_AGGLOMERATE_LOCAL = 2,
  LUMICUT_AGGLOMERATE_PARALLEL = 3
};
/* `count` boxes of six floats, least corner and greatest, by the area of joint boxes; or, with `dimension` from 1 to 16, balls
   of so many coordinates and a radius, by the radius of joint balls (dimension 0: boxes). merges: 2 (count - 1) numbers, the
   two clusters of each merge: below count leaves, count + k the result of merge k. costs: count - 1 of half such an area,
   or of such a radius; or NULL. */
LUMICUT_GEOMETRY_API int lumicut_agglomerate(const float* items, size_t count, int dimension, int strategy,
                                             uint32_t* merges, float* costs);

/* A dissimilarity of the caller's own, on clusters that are vectors of features. Of a joint cluster no feature may be below that
   of its parts (maxima and sums are not), and a cost must not fall when a feature of the other cluster rises: it then serves as
   its own bound. Called by several threads at a time where the strategy is parallel. */
typedef struct lumicut_dissimilarity {
  uint32_t struct_size;  /* sizeof(lumicut_dissimilarity) */
  uint32_t features;     /* 1 to 64 */
  uint32_t key_features; /* leaves whose first so many are equal are joined beforehand; 0: all */
  uint32_t may_decrease; /* 1: cost(a, b) may be above cost(a, b and c) [Eq. 1]; strategies naive and heap alone */
  void* user;            /* the first argument of the functions */
  /* The features of a and b together, the same as of b and a. */
  void (*merge)(void* user, const float* a, const float* b, float* joint);
  /* Of a with each of `count` (1 to 8) others, rows of features; symmetric, and not NaN. */
  void (*cost)(void* user, const float* a, const float* others, size_t count, float* costs);
  /* Up to eight coordinates by which clusters are sorted in space, for speed alone; or NULL: the first features. */
  void (*order)(void* user, const float* a, float* point);
} lumicut_dissimilarity;
/* leaves: `count` rows of features. merges and costs as above. */
LUMICUT_GEOMETRY_API int lumicut_agglomerate_by(const lumicut_dissimilarity* dissimilarity, const float* leaves,
                                                size_t count, int strategy, uint32_t* merges, float* costs);

/* ---- Ball trees [Omohundro 1989] ---- */
typedef struct lumicut_balltree_t* lumicut_balltree;
enum {
  LUMICUT_BALLTREE_KD = 0,
  LUMICUT_BALLTREE_TOP_DOWN = 1,
  LUMICUT_BALLTREE_INSERTION = 2,
  LUMICUT_BALLTREE_CHEAP_INSERTION = 3,
  LUMICUT_BALLTREE_BOTTOM_UP = 4
};
/* Leaf i is ball i. `radii`: NULL for points. Bottom-up takes at most 16 dimensions, the others 1024. */
LUMICUT_GEOMETRY_API int lumicut_balltree_create(const double* centres, const double* radii, size_t count,
                                                 int dimension, int builder, lumicut_balltree* tree);
LUMICUT_GEOMETRY_API void lumicut_balltree_release(lumicut_balltree tree);
LUMICUT_GEOMETRY_API int lumicut_balltree_insert(lumicut_balltree tree, const double* centre, double radius, int cheap,
                                                 uint32_t* leaf);
LUMICUT_GEOMETRY_API int lumicut_balltree_remove(lumicut_balltree tree, uint32_t leaf);
/* Each may be NULL. volume: the sum of radius^dimension over inner balls. */
LUMICUT_GEOMETRY_API int lumicut_balltree_measure(lumicut_balltree tree, size_t* leaves, double* volume, size_t* depth);
enum { LUMICUT_BALLTREE_CONTAINING = 0, LUMICUT_BALLTREE_INTERSECTING = 1, LUMICUT_BALLTREE_CONTAINED = 2 };
/* Leaves that hold each of `count` balls, touch it, or lie in it, ascending: those of query q are found[offsets[q]] to
   found[offsets[q + 1] - 1]. offsets: count + 1 numbers. `radii`: NULL for points. */
LUMICUT_GEOMETRY_API int lumicut_balltree_search(lumicut_balltree tree, int kind, const double* centres,
                                                 const double* radii, size_t count, size_t* offsets,
                                                 lumicut_indices* found);
/* The `nearest` leaves by their centres of each of `count` points, nearest first; LUMICUT_GEOMETRY_NONE fills up. */
LUMICUT_GEOMETRY_API int lumicut_balltree_nearest(lumicut_balltree tree, const double* points, size_t count,
                                                  size_t nearest, uint32_t* leaves);

/* The same by the distance to centres (0), to the nearest points of leaves (1; 0 inside) or to their furthest (2). */
LUMICUT_GEOMETRY_API int lumicut_balltree_nearest_by(lumicut_balltree tree, int by, const double* points, size_t count,
                                                     size_t nearest, uint32_t* leaves);
/* The leaf whose joint ball with each of `count` balls is least; LUMICUT_GEOMETRY_NONE of an empty tree. `radii`: NULL for
   points. */
LUMICUT_GEOMETRY_API int lumicut_balltree_best_mate(lumicut_balltree tree, const double* centres, const double* radii,
                                                    size_t count, uint32_t* leaves);

/* ---- Convex hull of a window that slides along a simple chain [Bus and Buzer 2015] ---- */
typedef struct lumicut_hull_t* lumicut_hull;
LUMICUT_GEOMETRY_API int lumicut_hull_create(int check_simple,
                                             lumicut_hull* hull); /* check_simple: tests each segment, slow */
LUMICUT_GEOMETRY_API void lumicut_hull_release(lumicut_hull hull);
/* The chain's newest points, one after the other, and its oldest. One that is refused ends the call: those before stay. */
LUMICUT_GEOMETRY_API int lumicut_hull_push(lumicut_hull hull, const double* points, size_t count);
LUMICUT_GEOMETRY_API int lumicut_hull_pop(lumicut_hull hull, size_t count);
LUMICUT_GEOMETRY_API int lumicut_hull_size(lumicut_hull hull, size_t* points, size_t* vertices);
/* Counter-clockwise and strictly convex, 2 numbers each; `vertices` has room for as many as lumicut_hull_size tells. */
LUMICUT_GEOMETRY_API int lumicut_hull_vertices(lumicut_hull hull, double* vertices);

/* ---- Hitting sets: few points that hit every disk [thesis ch. 5, 8] ---- */
typedef struct lumicut_hitting_set_info {
  size_t lower_bound; /* no set has fewer points */
  size_t empty_disks; /* that were dropped */
  size_t greedy;      /* size of the greedy set */
} lumicut_hitting_set_info;
/* drop_empty 0: a disk without points is an error. info may be NULL. */
LUMICUT_GEOMETRY_API int lumicut_hitting_set(const double* points, size_t point_count, const double* disks,
                                             size_t disk_count, int drop_empty, lumicut_indices* chosen,
                                             lumicut_hitting_set_info* info);
LUMICUT_GEOMETRY_API int lumicut_hitting_set_greedy(const double* points, size_t point_count, const double* disks,
                                                    size_t disk_count, int pruned, lumicut_indices* chosen);
/* Local search alone: up to `exchange` points (2 to 4) are given up for fewer, as long as it can be done. [Theorem 8.1] */
LUMICUT_GEOMETRY_API int lumicut_hitting_set_improve(const double* points, size_t point_count, const double* disks,
                                                     size_t disk_count, const uint32_t* start, size_t start_count,
                                                     int exchange, lumicut_indices* chosen);

/* The same for ranges of any kind: range i holds the points members[offsets[i]] to members[offsets[i + 1] - 1]; offsets:
   range_count + 1 numbers. exchange 0: the solver of lumicut_hitting_set; 2 to 4: local search from `start`. info may be NULL,
   and is written where exchange is 0. */
LUMICUT_GEOMETRY_API int lumicut_hitting_set_of_ranges(size_t point_count, const size_t* offsets,
                                                       const uint32_t* members, size_t range_count, int drop_empty,
                                                       const uint32_t* start, size_t start_count, int exchange,
                                                       lumicut_indices* chosen, lumicut_hitting_set_info* info);
/* The points in copies of a convex polygon, which are pseudodisks: `shape` has its corners, counter-clockwise around the origin;
   copies: x, y, size. offsets and members as above. */
LUMICUT_GEOMETRY_API int lumicut_points_in_copies(const double* points, size_t point_count, const double* shape,
                                                  size_t corner_count, const double* copies, size_t copy_count,
                                                  size_t* offsets, lumicut_indices* members);
/* The instance on which (3,2) local search is worst [Theorem 8.5]: small = (side + 1)(side + 2) / 2 points that hit all disks,
   then 4 side^2 that do too and that it cannot improve; 9 side^2 disks. side: 1 to 300. */
LUMICUT_GEOMETRY_API int lumicut_tight_instance(int side, double* points, double* disks);

/* Many disks that do not touch each other: up to `exchange` - 1 (exchange 2 to 4) are given up for one more. start_count 0:
   from small ones first. */
LUMICUT_GEOMETRY_API int lumicut_independent_disks(const double* disks, size_t disk_count, int exchange,
                                                   const uint32_t* start, size_t start_count, lumicut_indices* chosen);

/* ---- Face clusters of triangle meshes [Carr and Hart 2004] ---- */
typedef struct lumicut_face_clusters_t* lumicut_face_clusters;
typedef struct lumicut_face_clusters_desc {
  uint32_t struct_size; /* sizeof(lumicut_face_clusters_desc) */
  uint32_t clusters;    /* at least one a connected component is made; 0: 256 */
  double lambda;        /* of the distance [Eq. 8: 1 or more; Eq. 9: 0 to 1]; negative: 1 */
  double geodesic;      /* plain distance that is added where normals agree; negative: .001 */
  uint32_t metric;      /* 0: by normals of clusters [Eq. 8]; 1: by angles between faces [Eq. 9] */
  uint32_t random;      /* 1: first seeds at random, by `seed`, in place of bisection */
  uint64_t seed;
} lumicut_face_clusters_desc;
/* `vertices`: 3 numbers each; `faces`: 3 indices each. desc may be NULL. */
LUMICUT_GEOMETRY_API int lumicut_face_clusters_create(const double* vertices, size_t vertex_count,
                                                      const uint32_t* faces, size_t face_count,
                                                      const lumicut_face_clusters_desc* desc,
                                                      lumicut_face_clusters* clusters);
LUMICUT_GEOMETRY_API void lumicut_face_clusters_release(lumicut_face_clusters clusters);
/* Iterations until no label changes, at most `limit`; `iterations` may be NULL. */
LUMICUT_GEOMETRY_API int lumicut_face_clusters_run(lumicut_face_clusters clusters, size_t limit, size_t* iterations);
LUMICUT_GEOMETRY_API int lumicut_face_clusters_move(lumicut_face_clusters clusters,
                                                    const double* vertices); /* as many as before */
/* Splits until the error is at most `error`, or there are `most` clusters. */
LUMICUT_GEOMETRY_API int lumicut_face_clusters_refine(lumicut_face_clusters clusters, double error, size_t most);
/* error: the sum over faces of area times (1 - cosine to the cluster's normal). Each may be NULL; labels: one a face. */
LUMICUT_GEOMETRY_API int lumicut_face_clusters_read(lumicut_face_clusters clusters, uint32_t* labels, size_t* count,
                                                    double* error);

typedef struct lumicut_face_tree_t* lumicut_face_tree;
/* A binary tree of compact clusters, balanced by `weights`, one a face (NULL: areas). */
LUMICUT_GEOMETRY_API int lumicut_face_tree_create(const double* vertices, size_t vertex_count, const uint32_t* faces,
                                                  size_t face_count, const double* weights, lumicut_face_tree* tree);
LUMICUT_GEOMETRY_API void lumicut_face_tree_release(lumicut_face_tree tree);
LUMICUT_GEOMETRY_API int lumicut_face_tree_set_weights(lumicut_face_tree tree, const double* weights); /* rebalances */
/* One face's: its ancestors alone rebalance. */
LUMICUT_GEOMETRY_API int lumicut_face_tree_set_weight(lumicut_face_tree tree, uint32_t face, double weight);
/* Clusters of a level (the root is level 0), one label a face; imbalance: the tree's mean [Eq. 1]. Each may be NULL. */
LUMICUT_GEOMETRY_API int lumicut_face_tree_read(lumicut_face_tree tree, int level, uint32_t* labels, double* imbalance);

/* A texture atlas: a chart for each label, one a face, projected along its mean normal and packed into the unit square. corners: 6
   numbers a face, x and y of its corners. gap: between charts, 0 to .1. turned_away: faces that look away from their chart; or
   NULL. */
LUMICUT_GEOMETRY_API int lumicut_texture_atlas(const double* vertices, size_t vertex_count, const uint32_t* faces,
                                               size_t face_count, const uint32_t* labels, double gap, double* corners,
                                               size_t* turned_away);

/* ---- liblumicut_geometry_cgal (GPL) ---- */
/* Points in every disk that holds epsilon of the weight. `weights`: NULL for all alike; `thesis` 1: Algorithm 6 in place of the
   certified construction; c0: size of the sample times epsilon, 0 for the default. chosen: ascending. */
LUMICUT_GEOMETRY_API int lumicut_epsilon_net(const double* points, const double* weights, size_t count, double epsilon,
                                             int thesis, double c0, uint64_t seed, lumicut_indices* chosen);
/* The weight of the heaviest disk without a point of the net. */
LUMICUT_GEOMETRY_API int lumicut_heaviest_unhit_disk(const double* points, const double* weights, size_t count,
                                                     const uint32_t* net, size_t net_count, double* weight);
/* Hitting sets by rounding, in linear memory. [thesis ch. 7] */
LUMICUT_GEOMETRY_API int lumicut_hitting_set_dnet(const double* points, size_t point_count, const double* disks,
                                                  size_t disk_count, int drop_empty, uint64_t seed,
                                                  lumicut_indices* chosen);

#ifdef __cplusplus
}
#endif

#endif
