// lumicut-geometry recluster: face clusters that are kept up as a mesh moves.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "core/error.h"
#include "core/rng.h"
#include "geometry/command/commands.h"
#include "geometry/command/pictures.h"
#include "geometry/csv.h"
#include "geometry/face_cluster_tree.h"
#include "geometry/face_kmeans.h"
#include "geometry/mesh_file.h"
#include "geometry/texture_atlas.h"
#include "io/atomic_file.h"
#include "io/file_error.h"
#include "io/scene_obj.h"

namespace lumicut {
namespace {

struct Arguments {
  std::vector<std::string> meshes;  // the first one, then those of further frames
  std::string out = ".", method = "kmeans", weights, metric = "sander", atlas, atlas_picture;
  int frames = 30;
  FaceKmeansOptions kmeans;
  double error = 0;  // share of the surface; 0: none asked for
  FaceClusterTreeOptions tree;
  double gap = 1.0 / 512;
  bool boxes = false;
  int64_t random_seeds = -1;
  int level = 6;
  double reach = 0.25, amount = 0.15;
  int width = 800, height = 600;
  bool z_up = false, no_pictures = false;
};

// The mesh breathes: the parts around three vertices are pulled out and pushed in again, one after the other.
std::vector<Vec3d> deformed(const FaceMesh& m, double time, const Arguments& a) {
  Vec3d lo = m.vertices[0], hi = lo, mean;
  for (const Vec3d& v : m.vertices) lo = min(lo, v), hi = max(hi, v), mean += v;
  mean = mean / static_cast<double>(m.vertices.size());
  const double diagonal = length(hi - lo);
  std::vector<Vec3d> out = m.vertices;
  for (uint64_t k = 0; k < 3; ++k) {
    const double swing = std::sin(3.141592653589793 * std::clamp(3 * time - static_cast<double>(k), 0.0, 1.0));
    if (swing == 0) continue;
    const Vec3d at = m.vertices[hash64(k, 5) % m.vertices.size()],
                by = normalize(at - mean) * (a.amount * diagonal * swing);
    for (size_t i = 0; i < out.size(); ++i) {
      const double d = length(m.vertices[i] - at) / (a.reach * diagonal);
      if (d < 1) out[i] += by * ((1 - d) * (1 - d));
    }
  }
  return out;
}

FaceMesh read_mesh(const std::string& path) {
  io::Warnings warnings;
  const io::Mesh mesh = io::read_obj_positions(path, warnings);
  for (const auto& warning : warnings.lines()) std::fprintf(stderr, "lumicut-geometry: warning: %s\n", warning.c_str());
  FaceMesh faces = make_face_mesh(mesh.positions, mesh.indices);
  if (faces.faces.empty()) fail_argument(path + " has no faces");
  return faces;
}

// Frames one after the other: files of the user's, or the first one deformed.
class Frames {
 public:
  explicit Frames(const Arguments& a) : a_(a), start_(read_mesh(a.meshes[0])) {}

  const FaceMesh& start() const { return start_; }
  int count() const { return a_.meshes.size() > 1 ? static_cast<int>(a_.meshes.size()) : a_.frames; }
  std::vector<Vec3d> vertices(int frame) const {
    if (a_.meshes.size() == 1) return deformed(start_, static_cast<double>(frame) / a_.frames, a_);
    if (frame == 0) return start_.vertices;
    const std::string& path = a_.meshes[static_cast<size_t>(frame)];
    FaceMesh mesh = read_mesh(path);
    if (mesh.faces != start_.faces)
      fail_argument(path + ": its faces are not those of " + a_.meshes[0] + ", and frames differ by places alone");
    return std::move(mesh.vertices);
  }

 private:
  const Arguments& a_;
  FaceMesh start_;
};

void save(const Arguments& a, int frame, const FaceMesh& mesh, const std::vector<uint32_t>& labels) {
  std::vector<Colour> colours(labels.size());
  std::string text;
  for (size_t f = 0; f < labels.size(); ++f) {
    colours[f] = label_colour(labels[f]);
    text += std::to_string(labels[f]) + '\n';
  }
  char name[32];
  std::snprintf(name, sizeof name, "frame_%04d", frame);
  const std::string base = (std::filesystem::path(a.out) / name).string();
  io::write_whole_file(base + ".ply", ply_of(mesh, colours));
  io::write_whole_file(base + ".csv", text);
  if (a.boxes) {
    std::string rows = "cluster,x0,y0,z0,x1,y1,z1\n";
    char line[224];
    for (const ClusterBox& b : cluster_boxes(mesh, labels)) {
      std::snprintf(line, sizeof line, "%u,%.17g,%.17g,%.17g,%.17g,%.17g,%.17g\n", b.label, b.lo.x, b.lo.y, b.lo.z,
                    b.hi.x, b.hi.y, b.hi.z);
      rows += line;
    }
    io::write_whole_file(base + "_boxes.csv", rows);
  }
  if (!a.no_pictures) io::write_whole_file(base + ".png", png_of(draw_mesh(mesh, colours, a.width, a.height, a.z_up)));
}

// Of the last frame.
void save_atlas(const Arguments& a, const FaceMesh& mesh, const std::vector<uint32_t>& labels) {
  if (a.atlas.empty() && a.atlas_picture.empty()) return;
  const TextureAtlas atlas = make_texture_atlas(mesh, labels, a.gap);
  if (!a.atlas.empty()) write_text(a.atlas, obj_of(mesh, atlas));
  if (!a.atlas_picture.empty()) {
    std::vector<Colour> colours;
    for (const uint32_t label : labels) colours.push_back(label_colour(label));
    write_text(a.atlas_picture, png_of(draw_atlas(atlas.corners, colours, a.height)));
  }
  std::printf(
      "atlas: %zu charts cover %.1f %% of the square, are %.2f %% smaller than the surface; %zu faces turned away\n",
      atlas.charts, 100 * atlas.used, 100 * atlas.shrink, atlas.turned_away);
}

double area_of(const FaceMesh& mesh) {
  double area = 0;
  for (uint32_t f = 0; f < mesh.faces.size(); ++f) area += 0.5 * length(face_normal_area(mesh, f));
  return area;
}

std::vector<double> weights_of(const Arguments& a, const FaceMesh& mesh) {
  std::vector<double> weights;
  if (!a.weights.empty()) {
    auto file = open_text(a.weights);
    weights = read_weights_csv(file, a.weights);
    if (weights.size() != mesh.faces.size())
      fail_argument(a.weights + ": " + std::to_string(weights.size()) + " weights of " +
                    std::to_string(mesh.faces.size()) + " faces");
    return weights;
  }
  for (uint32_t f = 0; f < mesh.faces.size(); ++f) weights.push_back(0.5 * length(face_normal_area(mesh, f)));
  return weights;
}

int by_tree(const Arguments& a, const Frames& frames) {
  FaceMesh now = frames.start();
  FaceClusterTree tree(now, weights_of(a, now), a.tree);
  std::vector<uint32_t> labels;
  for (int frame = 0; frame < frames.count(); ++frame) {
    now.vertices = frames.vertices(frame);
    const std::vector<double> weights = weights_of(a, now);
    const auto t = std::chrono::steady_clock::now();
    tree.set_weights(weights);
    std::printf("frame %d: %.2f ms, mean imbalance %.3f\n", frame, 1e3 * seconds_since(t), tree.mean_imbalance(false));
    labels = tree.labels_at_level(a.level);
    save(a, frame, now, labels);
  }
  const FaceClusterTree::Topology t = tree.topology(now);
  std::printf("clusters of the tree: %zu discs, %zu with holes or touching themselves, %zu not connected\n", t.discs,
              t.holed, t.disconnected);
  save_atlas(a, now, labels);
  return 0;
}

int by_kmeans(const Arguments& a, const Frames& frames) {
  FaceMesh now = frames.start();
  FaceKmeansOptions options = a.kmeans;
  if (a.metric == "schlafman") options.metric = FaceKmeansOptions::Metric::schlafman;
  if (a.random_seeds >= 0) options.random_seeds = true, options.seed = static_cast<uint64_t>(a.random_seeds);
  FaceKmeans clusters(now, options);
  for (int frame = 0; frame < frames.count(); ++frame) {
    now.vertices = frames.vertices(frame);
    const auto t = std::chrono::steady_clock::now();
    if (frame > 0) clusters.move(now.vertices);
    const size_t iterations = clusters.run(frame > 0 ? 10 : 200);
    const double area = area_of(now);
    if (a.error > 0) clusters.refine(a.error * area, now.faces.size());
    std::printf("frame %d: %.2f ms, %zu iterations, %zu clusters, %zu cut edges, error %.4g of the surface\n", frame,
                1e3 * seconds_since(t), iterations, clusters.cluster_count(), clusters.cut_edges(),
                area > 0 ? clusters.error() / area : 0.0);
    save(a, frame, now, clusters.labels());
  }
  save_atlas(a, now, clusters.labels());
  return 0;
}

int run(const Arguments& a) {
  for (const auto& [name, value] : {std::pair{"--reach", a.reach},
                                    {"--amount", a.amount},
                                    {"--error", a.error},
                                    {"--gap", a.gap},
                                    {"--lambda", a.kmeans.lambda},
                                    {"--geodesic", a.kmeans.geodesic}})
    check_finite(name, value);
  if (!a.weights.empty() && a.method != "tree") fail_argument("--weights: of --method tree alone");
  if (a.error > 0 && a.method == "tree") fail_argument("--error: of --method kmeans alone");
  check_output(a.atlas), check_output(a.atlas_picture);
  io::check_distinct({a.atlas == "-" ? "" : a.atlas, a.atlas_picture});
  const Frames frames(a);
  std::error_code code;
  std::filesystem::create_directories(a.out, code);
  if (!std::filesystem::is_directory(a.out))
    throw io::FileError("--out " + a.out, code ? "cannot be made a folder: " + code.message() : "is no folder");
  return a.method == "tree" ? by_tree(a, frames) : by_kmeans(a, frames);
}

}  // namespace

Command add_recluster(CLI::App& app) {
  auto a = std::make_shared<Arguments>();
  auto* command = app.add_subcommand(
      "recluster", "Keeps face clusters up as a mesh moves; writes labels, coloured PLY and PNG frames");
  command->add_option("meshes", a->meshes, "OBJ file; or one a frame, with the same faces. A lone one is deformed")
      ->required();
  command->add_option("--out", a->out, "Folder of the frames: .ply, .png and .csv (a face's cluster a line)");
  command->add_option("--frames", a->frames, "How many, of a lone mesh")->check(CLI::Range(1, 100000));
  command->add_option("--method", a->method, "k-means clusters, or a level of the balanced tree")
      ->check(CLI::IsMember({"kmeans", "tree"}));
  command->add_option("--clusters", a->kmeans.clusters, "Of k-means");
  command->add_option("--lambda", a->kmeans.lambda, "Of k-means: of the distance; sander: 1 or more, schlafman: 0 to 1")
      ->check(CLI::Range(0.0, 1e6));
  command
      ->add_option("--metric", a->metric, "Of k-means: distance by normals of clusters [Eq. 8], or by angles [Eq. 9]")
      ->check(CLI::IsMember({"sander", "schlafman"}));
  command->add_option("--random-seeds", a->random_seeds, "Of k-means: first seeds at random, by this number")
      ->check(CLI::Range(int64_t{0}, int64_t{1} << 62));
  command->add_option("--geodesic", a->kmeans.geodesic, "Of k-means: plain distance that is added where normals agree")
      ->check(CLI::Range(0.0, 1e6));
  command
      ->add_option("--error", a->error,
                   "Of k-means: splits clusters until so much of the surface, or less, turns away from their normals "
                   "(0: --clusters alone)")
      ->check(CLI::Range(0.0, 1.0));
  command->add_option("--level", a->level, "Of the tree")->check(CLI::Range(0, 64));
  command->add_option("--weights", a->weights, "Of the tree: CSV, a weight a line for each face (none: areas)");
  command
      ->add_option("--bloom-bits", a->tree.bloom_bits,
                   "Of the tree: perimeters in Bloom filters of so many bits (0: exact)")
      ->check(CLI::Range(0, 1 << 24));
  command->add_option("--bloom-hashes", a->tree.bloom_hashes, "Bits that an edge sets in them")
      ->check(CLI::Range(1, 16));
  command->add_flag("--simply-connected", a->tree.simply_connected,
                    "Of the tree: refuses changes that make clusters other than discs");
  command->add_option("--atlas", a->atlas, "OBJ with texture coordinates: a chart for each cluster of the last frame");
  add_picture_option(*command, "--atlas-picture", a->atlas_picture, "PNG of its charts, as high as --height", {".png"});
  command->add_option("--gap", a->gap, "Between charts, in parts of the texture")->check(CLI::Range(0.0, 0.1));
  command->add_flag("--boxes", a->boxes, "Also a CSV of each frame's clusters' bounding boxes");
  command->add_option("--reach", a->reach, "Of the deformation, in diagonals")->check(CLI::Range(1e-6, 100.0));
  command->add_option("--amount", a->amount, "Of the deformation, in diagonals")->check(CLI::Range(0.0, 100.0));
  command->add_option("--width", a->width, "Of the pictures")->check(CLI::Range(16, 10000));
  command->add_option("--height", a->height, "Of the pictures")->check(CLI::Range(16, 10000));
  command->add_flag("--no-pictures", a->no_pictures, "Write no PNG");
  command->add_flag("--z-up", a->z_up, "The mesh stands along z");
  return [a] { return run(*a); };
}

}  // namespace lumicut
