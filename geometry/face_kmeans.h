// A fixed number of face clusters, kept up as the mesh moves: region growing in the manner of k-means. [Carr & Hart
// 2004, sec. 4; the distance is Sander's, Eq. 8]
//
// One iteration: clusters grow outwards from their seed faces (phase 1), then each cluster's seed moves to the face
// furthest from its border (phase 2). Three ways that give the same labels after every iteration:
// - single_heap: the plain method, one indexed heap over all faces;
// - nested_heaps: a heap per cluster under a heap of clusters (Fig. 6);
// - incremental: only clusters whose faces changed grow anew (sec. 4.3), starting at their neighbours' border sets.
// Departs from the paper:
// - sec. 4.3's rule for skipping (a cluster and its neighbours unchanged) is not exact: a cluster may be overrun from
//   further away. Here faces of unchanged clusters keep their distances until a better one arrives; the faces reached
//   through a lost face are then reset, and grow again from around them.
// - Eq. 8 with lambda = 1 is 0 on plane regions; `geodesic` adds a little of the plain distance.
// - Eq. 9 sets angles against lengths; these are divided by the mesh's mean distance between neighbouring faces, so
//   that the unit does not matter.
// - ties go to the smaller cluster; a sequence of labels that comes again ends the iterations.
// - hysteresis on normals and seeds, without which few clusters ever come to rest (docs/benchmarks_geometry.md).
// - merging and splitting, which the paper leaves to be done.
#pragma once

#include <cstdint>
#include <span>
#include <unordered_set>
#include <vector>

#include "geometry/face_mesh.h"

namespace lumicut {

struct FaceKmeansOptions {
  enum class Method { single_heap, nested_heaps, incremental };
  Method method = Method::incremental;
  enum class Metric {
    sander,     // Eq. 8: (lambda - cosine to the cluster's normal) times distance; lambda 1 or more
    schlafman,  // Eq. 9: (1 - lambda)(1 - cosine² between the faces) + lambda times distance; lambda in [0, 1]
  };
  Metric metric = Metric::sander;
  uint32_t clusters = 256;  // at least one a connected component is made
  double lambda = 1.0;
  bool random_seeds = false;  // first seeds: faces at random, in place of bisection
  uint64_t seed = 0;          // of those
  double geodesic = 1e-3;
  // Hysteresis; 0 and 0 is the paper. A cluster's normal in Eq. 8 follows once it has turned by more than this
  // (radians), and its seed moves when the new face is further inside than the old one by more than this share.
  double normal_tolerance = 0.05;
  double seed_tolerance = 0.15;
};

class FaceKmeans {
 public:
  static constexpr uint32_t kNone = 0xffffffffu;
  enum class State { changed, converged, cycle };

  // Seeds by recursive bisection across the widest axis of inertia. Throws invalid_argument on a bad mesh (see
  // validate_mesh) or option.
  FaceKmeans(FaceMesh mesh, const FaceKmeansOptions& options);

  // One iteration. `converged`: no label changed; `cycle`: these labels have been before (since the last move).
  State iterate();
  // Iterations until converged or in a cycle, `limit` at most; returns how many.
  size_t run(size_t limit = 1000);
  // New positions, same topology. Clusters with a face that moved grow anew.
  void move(std::span<const Vec3d> vertices);

  // Joins two neighbouring clusters into the first. Throws invalid_argument when they do not touch.
  void merge(uint32_t a, uint32_t b);
  // Gives a cluster a second seed, the face furthest from its own; returns the new cluster, kNone for a single face.
  uint32_t split(uint32_t c);
  // A merge where it costs least, then a split where the error is largest [region teleportation]. False: neither.
  bool teleport();
  // Splits the clusters of largest error, an eighth of all in a round, with up to 20 iterations behind each, until
  // error() is at most `error` or there are `most` clusters; returns how many there are.
  size_t refine(double error, size_t most);

  const FaceMesh& mesh() const { return mesh_; }
  const DualGraph& graph() const { return graph_; }
  const std::vector<uint32_t>& labels() const { return label_; }  // by face; no gaps but after merges
  const std::vector<uint32_t>& seeds() const { return seed_; }    // by cluster; kNone: none any more
  size_t cluster_count() const;
  size_t regrown_faces() const { return regrown_; }  // in the last iteration: faces whose distance was computed
  size_t cut_edges() const;                          // pairs of neighbouring faces in different clusters
  double error() const;                              // sum over faces of area times (1 - normal · cluster's normal)

 private:
  struct Entry {
    double key;
    uint32_t cluster, face;
    bool operator>(const Entry& o) const {
      return key != o.key ? key > o.key : cluster != o.cluster ? cluster > o.cluster : face > o.face;
    }
  };
  double cost(uint32_t cluster, uint32_t from, uint32_t to) const;
  void geometry_of(uint32_t f);
  void choose_seeds(uint32_t k);
  void bisect(uint32_t k);
  void grow_all_single();
  void grow_all_nested();
  void grow_incremental();
  bool recentre(uint32_t c);                         // true: the seed moved
  bool update_normal(uint32_t c, double tolerance);  // true: the normal in use turned
  uint64_t hash_state() const;
  double error_of(const std::vector<uint32_t>& faces) const;

  FaceMesh mesh_;
  DualGraph graph_;
  FaceKmeansOptions options_;
  std::vector<Vec3d> centre_, normal_;  // by face; unit normals, zero for degenerate faces
  std::vector<double> area_;
  double unit_ = 1;  // of lengths in Eq. 9
  std::vector<uint32_t> label_, previous_, seed_, pred_;
  std::vector<double> dist_, inner_;
  std::vector<Vec3d> cluster_normal_;
  std::vector<std::vector<uint32_t>> faces_;  // by cluster, ascending
  std::vector<uint8_t> dirty_;                // by cluster
  std::vector<Entry> heap_;
  std::vector<uint32_t> touched_, stamp_, stack_;
  uint32_t stamp_now_ = 0;
  size_t regrown_ = 0;
  std::unordered_set<uint64_t> history_;
};

}  // namespace lumicut
