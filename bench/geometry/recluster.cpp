// Face clusters on deforming meshes: the balanced tree (Carr & Hart 2004, tables 3-7) and k-means (fig. 7), beside
// METIS and meshoptimizer. Needs the scenes (LUMICUT_SCENES); deformations are generated.
//
//   bench_recluster [tree | kmeans]
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <memory>
#include <vector>

#include "bench_util.h"
#include "core/rng.h"
#include "geometry/face_cluster_tree.h"
#include "geometry/face_kmeans.h"
#include "geometry/mesh_file.h"
#include "io/scene_obj.h"
#ifdef LUMICUT_HAS_METIS
#include <metis.h>
#endif
#ifdef LUMICUT_HAS_MESHOPTIMIZER
#include <meshoptimizer.h>
#endif

namespace lumicut::bench {
namespace {

// A bumpy torus of 9216 faces, in place of the scenes' meshes.
FaceMesh torus() {
  constexpr uint32_t rows = 72, columns = 64;
  FaceMesh m;
  for (uint32_t i = 0; i < rows; ++i)
    for (uint32_t j = 0; j < columns; ++j) {
      const double a = 2 * M_PI * i / rows, b = 2 * M_PI * j / columns,
                   r = 0.4 + 0.05 * std::sin(5 * a) * std::cos(3 * b);
      m.vertices.push_back({(1 + r * std::cos(b)) * std::cos(a), r * std::sin(b), (1 + r * std::cos(b)) * std::sin(a)});
      const uint32_t down = (i + 1) % rows * columns, right = (j + 1) % columns, here = i * columns;
      m.faces.push_back({here + j, down + j, down + right});
      m.faces.push_back({here + j, down + right, here + right});
    }
  return m;
}

FaceMesh load(const std::string& scenes, const char* name) {
  if (smoke()) return torus();
  io::Warnings warnings;
  const io::Mesh mesh = io::read_obj_positions(scenes + "/" + name + "/" + name + ".obj", warnings);
  return make_face_mesh(mesh.positions, mesh.indices);
}

Vec3d extent(const FaceMesh& m) {
  Vec3d lo = m.vertices[0], hi = lo;
  for (const Vec3d& v : m.vertices) lo = min(lo, v), hi = max(hi, v);
  return hi - lo;
}

// Pulls a ball of the mesh around a vertex outwards; `reach` and `amount` in parts of the diagonal.
std::vector<Vec3d> pull(const FaceMesh& m, uint32_t vertex, double reach, double amount) {
  const double diagonal = length(extent(m));
  Vec3d mean;
  for (const Vec3d& v : m.vertices) mean += v;
  mean = mean / static_cast<double>(m.vertices.size());
  const Vec3d at = m.vertices[vertex], by = normalize(at - mean) * (amount * diagonal);
  std::vector<Vec3d> out = m.vertices;
  for (Vec3d& v : out) {
    const double d = length(v - at) / (reach * diagonal);
    if (d < 1) v += by * ((1 - d) * (1 - d));
  }
  return out;
}

void tree(const std::string& scenes) {
  std::printf(
      "\n## tree: mean imbalance of inner nodes (and of all nodes), after factors in [.5, 2] and rebalancing; "
      "seconds\n");
  std::printf("%-6s %7s | %14s %8s %9s %9s | %14s %9s | %12s %10s\n", "mesh", "faces", "imbalance", "build s",
              "lists MB", "unjoined", "after noise", "rebal. s", "bloom MB", "rle MB");
  for (const char* name : {"cow", "bunny", "horse"}) {
    const FaceMesh m = load(scenes, name);
    std::unique_ptr<FaceClusterTree> t;
    const double build = time_of([&] { t = std::make_unique<FaceClusterTree>(m, std::span<const double>()); });
    std::printf("%-6s %7zu | %6.3f (%5.3f) %8.2f %9.2f %9zu |", name, m.faces.size(), t->mean_imbalance(false),
                t->mean_imbalance(true), build, static_cast<double>(t->perimeter_bytes()) / 1e6,
                t->disconnected_clusters(dual_graph(m)));
    const uint32_t sizes[] = {1000, 8000};
    FaceClusterTree::Bloom rows[2][4];
    for (int k = 0; k < 4; ++k)
      for (int hashes : {1, 2}) rows[hashes - 1][k] = t->bloom_statistics(2048u << k, hashes, sizes);
    const double bytes = static_cast<double>(rows[1][2].bytes) / 1e6,
                 rle = static_cast<double>(rows[1][2].run_length_bytes) / 1e6;
    Rng rng(1, Stage::test);
    std::vector<double> w(m.faces.size());
    for (size_t f = 0; f < w.size(); ++f) w[f] = t->nodes()[f].weight * std::exp2(2 * rng.next_float() - 1);
    const double again = time_of([&] { t->set_weights(w); });
    std::printf(" %6.3f (%5.3f) %9.3f | %12.1f %10.1f\n", t->mean_imbalance(false), t->mean_imbalance(true), again,
                bytes, rle);
    // The same weights one after the other, as the paper does it.
    FaceClusterTree one(m, {});
    const double each = time_of([&] {
      for (uint32_t f = 0; f < w.size(); ++f) one.set_weight(f, w[f]);
    });
    std::printf("       one face's weight at a time: %.1f us a face, imbalance %.3f\n",
                1e6 * each / static_cast<double>(w.size()), one.mean_imbalance(false));
    for (size_t r = 0; r < 2; ++r) {
      if (rows[0][0].rows[r].nodes == 0) continue;
      for (const int hashes : {1, 2}) {
        std::printf(
            "       bits lost at %u faces, %d an edge, measured / model (Eq. 7, its perimeter), m = 2K 4K 8K 16K:",
            sizes[r], hashes);
        for (int k = 0; k < 4; ++k) {
          double n = 3 * hashes, e = n;
          const double bits = 2048 << k;
          for (double size = 1; size < 0.99 * sizes[r]; size *= 2) n = 1.5 * n * (1 - n / bits), e *= 1.5;
          std::printf(" %.3f/%.3f", rows[hashes - 1][k].rows[r].loss, 1 - n / e);
        }
        std::printf("  perimeter %.0f\n", rows[0][0].rows[r].edges);
      }
    }
    std::fflush(stdout);
  }
}

// Exact perimeters of inner clusters of 64 faces and more, over the square root of their faces: 3.7 is a disc's.
double roundness(const FaceClusterTree& t, const DualGraph& graph) {
  const auto& nodes = t.nodes();
  double sum = 0;
  size_t count = 0;
  std::vector<uint8_t> odd(graph.edge_vertices.size(), 0);
  std::vector<uint32_t> stack, edges;
  for (uint32_t x = 0; x < nodes.size(); ++x) {
    if (nodes[x].faces < 64) continue;
    edges.clear();
    stack.assign(1, x);
    while (!stack.empty()) {
      const uint32_t y = stack.back();
      stack.pop_back();
      if (nodes[y].left != FaceClusterTree::kNone) {
        stack.push_back(nodes[y].left), stack.push_back(nodes[y].right);
        continue;
      }
      for (const uint32_t e : graph.edges_of(y)) edges.push_back(e), odd[e] ^= 1;
    }
    size_t perimeter = 0;
    for (const uint32_t e : edges)
      if (odd[e]) odd[e] = 0, ++perimeter;
    sum += static_cast<double>(perimeter) / std::sqrt(static_cast<double>(nodes[x].faces)), ++count;
  }
  return count ? sum / static_cast<double>(count) : 0;
}

void filters(const std::string& scenes) {
  std::printf("\n## filters: Table 1 (bits lost at a leaf), Table 2 (edges of a perimeter), by Eq. 3-6\n");
  for (const double m : {2048.0, 4096.0, 8192.0}) {
    std::printf("m = %5.0f bits:", m);
    for (const double e : {3.0, 6.0})
      std::printf("  e = %.0f: %.4f %%", e, 100 * (1 - m / e * (1 - std::pow((m - 1) / m, e))));
    std::printf("\n");
  }
  for (const int level : {10, 13, 18, 20}) {
    std::printf("%8d faces:", 1 << level);
    for (const double c : {1 / 3.0, 1 / 4.0, 1 / 6.0}) std::printf(" %8.0f", 3 * std::pow(2 * (1 - c), level));
    std::printf("  (c = 1/3, 1/4, 1/6)\n");
  }
  std::printf(
      "\n## trees that work with the filters: imbalance, perimeter over square root of faces, clusters that are discs, "
      "with holes, not connected; seconds\n");
  for (const char* name : {"cow", "bunny"}) {
    const FaceMesh m = load(scenes, name);
    const DualGraph graph = dual_graph(m);
    const auto row = [&](const char* what, const FaceClusterTreeOptions& o) {
      std::unique_ptr<FaceClusterTree> t;
      const double s = time_of([&] { t = std::make_unique<FaceClusterTree>(m, std::span<const double>(), o); });
      const auto topology = t->topology(m);
      std::printf("%-6s %-26s %6.3f %6.2f %7zu %5zu %5zu %8.2f %8.2f MB\n", name, what, t->mean_imbalance(false),
                  roundness(*t, graph), topology.discs, topology.holed, topology.disconnected, s,
                  static_cast<double>(t->perimeter_bytes()) / 1e6);
      std::fflush(stdout);
    };
    row("exact", {});
    FaceClusterTreeOptions o;
    o.simply_connected = true;
    row("exact, simply connected", o);
    o.simply_connected = false;
    for (const int hashes : {1, 2})
      for (uint32_t bits = 512; bits <= 8192; bits *= 4) {
        o.bloom_bits = bits, o.bloom_hashes = hashes;
        row((std::to_string(bits) + " bits, " + std::to_string(hashes) + " an edge").c_str(), o);
      }
  }
}

void rivals([[maybe_unused]] const FaceMesh& m, uint32_t k, size_t cut, double seconds) {
  // m: METIS and meshoptimizer may both be absent.
  std::printf("       cut edges at k = %u: ours %zu (%.2f s)", k, cut, seconds);
#ifdef LUMICUT_HAS_METIS
  const DualGraph g = dual_graph(m);
  std::vector<idx_t> offset(g.offset.begin(), g.offset.end()), neighbour(g.neighbour.begin(), g.neighbour.end()),
      part(m.faces.size());
  idx_t n = static_cast<idx_t>(m.faces.size()), one = 1, parts = static_cast<idx_t>(k), edge_cut = 0;
  int status = 0;
  const double metis = time_of([&] {
    status = METIS_PartGraphKway(&n, &one, offset.data(), neighbour.data(), nullptr, nullptr, nullptr, &parts, nullptr,
                                 nullptr, nullptr, &edge_cut, part.data());
  });
  if (status == METIS_OK) std::printf(", METIS %lld (%.2f s)", static_cast<long long>(edge_cut), metis);
#endif
#ifdef LUMICUT_HAS_MESHOPTIMIZER
  std::vector<unsigned> indices;
  std::vector<float> positions;
  for (const auto& f : m.faces) indices.insert(indices.end(), f.begin(), f.end());
  for (const Vec3d& v : m.vertices)
    positions.insert(positions.end(), {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)});
  // meshlets of at most 255 vertices and 512 triangles; the target size is that of our clusters, as far as it goes
  const size_t most = std::min<size_t>(512, m.faces.size() / k / 4 * 4);
  std::vector<meshopt_Meshlet> meshlets(meshopt_buildMeshletsBound(indices.size(), 255, most));
  std::vector<unsigned> vertices(meshlets.size() * 255);
  std::vector<unsigned char> triangles(meshlets.size() * most * 3);
  size_t count = 0;
  const double meshopt = time_of([&] {
    count = meshopt_buildMeshlets(meshlets.data(), vertices.data(), triangles.data(), indices.data(), indices.size(),
                                  positions.data(), m.vertices.size(), 12, 255, most, 0.5f);
  });
  std::printf(", meshoptimizer %zu meshlets (%.2f s)", count, meshopt);
#endif
  std::printf("\n");
}

void kmeans(const std::string& scenes) {
  using Method = FaceKmeansOptions::Method;
  std::printf(
      "\n## k-means: ms an iteration (mean over all; first; last 10), faces touched late, iterations; 80 iterations, "
      "seconds\n");
  for (const char* name : {"bunny", "horse"}) {
    const FaceMesh m = load(scenes, name);
    const auto k = sized<uint32_t>(256, 32);
    size_t cut = 0;
    double total = 0;
    FaceKmeansOptions o;
    o.clusters = k;
    const char* names[] = {"single", "nested", "increm."};
    std::vector<uint32_t> labels[3];
    for (int i = 0; i < 3; ++i) {
      o.method = i == 0 ? Method::single_heap : i == 1 ? Method::nested_heaps : Method::incremental;
      FaceKmeans c(m, o);
      std::vector<double> ms;
      double eighty = 0;
      size_t touched = 0;
      auto state = FaceKmeans::State::changed;
      while (state == FaceKmeans::State::changed && ms.size() < sized<size_t>(400, 20)) {
        ms.push_back(1e3 * time_of([&] { state = c.iterate(); }));
        if (ms.size() <= 80) eighty += ms.back() / 1e3;
        touched = c.regrown_faces();
      }
      double mean = 0, late = 0;
      for (const double x : ms) mean += x;
      total = mean / 1e3;
      mean /= static_cast<double>(ms.size());
      const size_t tail = std::min<size_t>(10, ms.size());
      for (size_t j = ms.size() - tail; j < ms.size(); ++j) late += ms[j] / static_cast<double>(tail);
      std::printf(
          "%-6s %7zu %-8s mean %7.2f first %7.2f late %7.2f (%5.1f %% of first), %6zu faces, %3zu iterations, %s; 80 "
          "take %6.2f s\n",
          name, m.faces.size(), names[i], mean, ms[0], late, 100 * late / ms[0], touched, ms.size(),
          state == FaceKmeans::State::converged ? "converged" : "cycle", eighty);
      std::fflush(stdout);
      labels[i] = c.labels();
      cut = c.cut_edges();
      if (i != 2) continue;
      // A local pull, little by little: one frame is a move and five iterations.
      FaceMesh moving = m;
      std::vector<double> frames;
      for (int frame = 0; frame < 30; ++frame) {
        const auto next = pull(moving, 1234, 0.05, 0.004);
        frames.push_back(1e3 * time_of([&] {
                           c.move(next);
                           c.run(5);
                         }));
        moving.vertices = next;
      }
      std::sort(frames.begin(), frames.end());
      std::printf(
          "       local deformation, a move and up to 5 iterations: median %.2f ms, worst %.2f ms (60 Hz is 16.7)\n",
          frames[15], frames.back());
      frames.clear();
      for (int frame = 0; frame < 10; ++frame) {
        const auto next = pull(moving, 4321, 2.0, 0.01);
        frames.push_back(1e3 * time_of([&] {
                           c.move(next);
                           c.run(5);
                         }));
        moving.vertices = next;
      }
      std::sort(frames.begin(), frames.end());
      std::printf("       the whole mesh deforming, a move and up to 5 iterations: median %.2f ms, worst %.2f ms\n",
                  frames[5], frames.back());
    }
    std::printf("       labels of the three in the end: %s\n",
                labels[0] == labels[1] && labels[0] == labels[2] ? "equal" : "DIFFER");
    rivals(m, k, cut, total);
  }
}

}  // namespace
}  // namespace lumicut::bench

int main(int argc, char** argv) {
  using namespace lumicut::bench;
  print_header("Face clusters on deforming meshes", argc, argv, 1);
  const std::string scenes = scenes_folder();
  if (scenes.empty() && !smoke()) {
    std::printf("# skipped: no scenes (set LUMICUT_SCENES)\n");
    return 0;
  }
  if (argc < 2 || !std::strcmp(argv[1], "tree")) tree(scenes);
  if (argc < 2 || !std::strcmp(argv[1], "filters")) filters(scenes);
  if (argc < 2 || !std::strcmp(argv[1], "kmeans")) kmeans(scenes);
}
