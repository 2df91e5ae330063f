// A binary tree of face clusters, balanced by weight and kept compact by perimeter. [Carr & Hart 2004, sec. 3]
//
// Departs from the paper:
// - perimeters are exact sorted lists of edge ids, joined by symmetric difference; they take a fraction of the Bloom
//   filters' memory. `bloom_statistics` says what the filters would lose and take (Tables 1-4, 6, 7). With `bloom_bits`
//   the tree works with the filters themselves, as sorted lists of the bits that are set, which lose what they lose.
// - the choice follows the text of sec. 3.2, not Fig. 3: an unbalanced node takes the compactest perturbation that
//   brings it closer to balance, compacter than what it is or not, out of all that keep both clusters joined.
// - of perturbations with equal perimeters the one of least imbalance is taken, and a last phase takes what lessens it
//   and makes perimeters at most `slack` longer: near the leaves perimeters alone decide little.
// - the mutual recursion of Fig. 3 need not end; a call makes at most `max_steps` perturbations.
// - components of the mesh are built apart and then joined by weight; on non-manifold edges an edge is in a perimeter
//   when an odd number of its faces is in the cluster.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "geometry/face_mesh.h"

namespace lumicut {

struct FaceClusterTreeOptions {
  double alpha = 0.25;  // Eq. 2
  double tau = 1.0;     // imbalance that is still acceptable
  double slack = 0.1;   // share by which a last phase may lengthen perimeters for balance
  int max_steps = 24;   // perturbations that one rebalancing may cause
  int max_passes = 16;  // over the whole tree, after building and after new weights
  // Bits of a Bloom filter a node, of which an edge sets `bloom_hashes` (0: exact perimeters, all below is then open).
  uint32_t bloom_bits = 0;
  int bloom_hashes = 2;
  // Perturbations that would make a cluster other than a disc (holes, or touching itself in a vertex) are refused, and
  // those that mend one come first. What breadth-first growth closes around stays: `topology` counts it.
  bool simply_connected = false;
};

class FaceClusterTree {
 public:
  static constexpr uint32_t kNone = 0xffffffffu;
  struct Node {
    uint32_t left = kNone, right = kNone, parent = kNone;
    uint32_t faces = 1;  // leaves below
    double weight = 0;
    int32_t euler = 1;                // vertices - edges + faces; kept with simply_connected alone
    std::vector<uint32_t> perimeter;  // edge ids (or bits of the filter), ascending
  };

  // `weights`: one a face, finite and not negative; empty: areas. Throws invalid_argument on bad input.
  FaceClusterTree(const FaceMesh& mesh, std::span<const double> weights, const FaceClusterTreeOptions& options = {});

  // New weights (a signal that changed, a mesh that moved): all of the tree is rebalanced, leaves first.
  void set_weights(std::span<const double> weights);

  // One face's: its ancestors rebalance, in O(depth).
  void set_weight(uint32_t face, double weight);

  // Node f is face f's leaf; inner nodes follow. `root` is kNone for a mesh without faces.
  const std::vector<Node>& nodes() const { return nodes_; }
  uint32_t root() const { return root_; }
  double imbalance(uint32_t node) const;  // Eq. 1
  double mean_imbalance(bool with_leaves) const;
  size_t perturbations() const { return perturbations_; }
  size_t perimeter_bytes() const;
  // Clusters of a level (the root is level 0), numbered from 0: a label a face.
  std::vector<uint32_t> labels_at_level(int level) const;
  // Inner clusters, of up to all components, that are not connected.
  size_t disconnected_clusters(const DualGraph& graph) const;

  struct Topology {
    size_t discs = 0;         // connected, without holes, and no vertex where they touch themselves
    size_t holed = 0;         // connected, but no discs
    size_t disconnected = 0;  // of the inner clusters
  };
  Topology topology(const FaceMesh& mesh) const;

  struct Bloom {
    uint64_t bytes = 0, run_length_bytes = 0;  // of all nodes
    struct Row {
      uint32_t faces;  // nodes with about so many (within a factor of sqrt 2)
      size_t nodes = 0;
      double edges = 0, loss = 0;  // means: exact perimeter, and the share of set bits that collisions lost
    };
    std::vector<Row> rows;
  };
  // What Bloom filters of `bits` bits and `hashes` bits an edge would be, node by node.
  Bloom bloom_statistics(uint32_t bits, int hashes, std::span<const uint32_t> sizes) const;

 private:
  struct Choice;
  void set_children(uint32_t n, uint32_t a, uint32_t b);
  void refresh(uint32_t n);
  int32_t joint_euler(uint32_t a, uint32_t b, int shared_edges) const;
  void rebalance(uint32_t n, int& steps);
  void settle();
  static double imbalance_of(double a, double b);
  std::vector<uint32_t> postorder() const;
  void members_of(uint32_t node, std::vector<uint32_t>& members, std::vector<uint32_t>& stack) const;

  FaceClusterTreeOptions options_;
  std::vector<std::array<uint32_t, 2>> edge_vertices_;  // of simply_connected
  std::vector<Node> nodes_;
  uint32_t root_ = kNone;
  size_t perturbations_ = 0;
  bool polishing_ = false;  // the last phase
};

}  // namespace lumicut
