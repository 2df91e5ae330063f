// lumicut-geometry: the geometry library from the command line.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <sstream>

#include "core/error.h"
#include "core/rng.h"
#include "geometry/command/pictures.h"
#include "geometry/csv.h"
#include "geometry/face_cluster_tree.h"
#include "geometry/face_kmeans.h"
#include "geometry/hitting_set.h"
#include "geometry/mesh_file.h"
#include "io/atomic_file.h"
#include "io/file_error.h"
#include "io/scene_obj.h"
#include "io/standard_streams.h"
#ifdef LUMICUT_HAS_CGAL
#include "geometry/dnet.h"
#include "geometry/epsilon_net.h"
#endif

namespace lumicut {
namespace {

std::istringstream open(const std::string& path) { return std::istringstream(io::read_whole_file(path)); }

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

void write_points(const std::string& path, const std::vector<Point2>& points, const std::vector<uint32_t>& chosen) {
  std::string text = "index,x,y\n";
  char line[96];
  for (const uint32_t i : chosen) {
    std::snprintf(line, sizeof line, "%u,%.17g,%.17g\n", i, points[i].x, points[i].y);
    text += line;
  }
  if (path == "-") {
    std::fwrite(text.data(), 1, text.size(), stdout);
  } else {
    io::write_whole_file(path, text);
  }
}

struct HittingArguments {
  std::string points, disks, out = "-", picture, method = "default";
  bool drop_empty = false;
  int size = 1000;
};

void check_output(const std::string& path) {
  if (path != "-") io::check_writable(path);
}

int hitting_set(const HittingArguments& a) {
  check_output(a.out);
  io::check_distinct({a.out == "-" ? "" : a.out, a.picture});
  if (!a.picture.empty()) io::check_writable(a.picture);
  auto points_file = open(a.points), disks_file = open(a.disks);
  const auto points = read_points_csv(points_file, a.points);
  const auto disks = read_disks_csv(disks_file, a.disks);
  const auto start = std::chrono::steady_clock::now();
  std::vector<uint32_t> chosen;
  if (a.method == "default") {
    HittingSetOptions o;
    o.drop_empty_disks = a.drop_empty;
    const HittingSet h = solve_hitting_set(points, disks, o);
    chosen = h.points;
    std::fprintf(stderr,
                 "%zu points hit %zu disks (%zu empty ones dropped); no set has fewer than %zu, gap %.2f %%; greedy "
                 "%zu; %.2f s\n",
                 chosen.size(), disks.size() - h.empty_disks, h.empty_disks, h.lower_bound, 100 * h.gap(), h.greedy,
                 seconds_since(start));
  } else if (a.method == "greedy") {
    chosen = greedy_hitting_set(points, disks, true);
    std::fprintf(stderr, "%zu points hit %zu disks; %.2f s\n", chosen.size(), disks.size(), seconds_since(start));
  } else {
#ifdef LUMICUT_HAS_CGAL
    DnetOptions o;
    o.drop_empty_disks = a.drop_empty;
    chosen = dnet_hitting_set(points, disks, o).points;
    std::fprintf(stderr, "%zu points hit %zu disks; %.2f s\n", chosen.size(), disks.size(), seconds_since(start));
#else
    fail_argument("--method dnet: this command was built without CGAL");
#endif
  }
  write_points(a.out, points, chosen);
  if (!a.picture.empty())
    io::write_whole_file(a.picture, draw_hitting_set(a.picture.ends_with(".svg"), points, disks, chosen, a.size));
  return 0;
}

struct NetArguments {
  std::string points, out = "-";
  double epsilon = 0.01;
  bool thesis = false;
};

int net(const NetArguments& a) {
#ifdef LUMICUT_HAS_CGAL
  check_output(a.out);
  auto file = open(a.points);
  const auto points = read_points_csv(file, a.points);
  EpsilonNetOptions o;
  if (a.thesis) o.mode = EpsilonNetOptions::Mode::thesis;
  const EpsilonNet n = epsilon_net(points, {}, a.epsilon, o);
  std::fprintf(stderr, "%zu points, %.2f/epsilon; the heaviest disk without one holds %.0f of %zu points\n",
               n.points.size(), static_cast<double>(n.points.size()) * a.epsilon,
               heaviest_unhit_disk(points, {}, n.points), points.size());
  write_points(a.out, points, n.points);
  return 0;
#else
  (void)a;
  fail_argument("net: this command was built without CGAL");
#endif
}

struct ReclusterArguments {
  std::string mesh, out = ".", method = "kmeans";
  int frames = 30;
  uint32_t clusters = 256;
  int level = 6;
  double reach = 0.25, amount = 0.15;
  int width = 800, height = 600;
  bool z_up = false;
};

// The mesh breathes: the parts around three vertices are pulled out and pushed in again, one after the other.
std::vector<Vec3d> deformed(const FaceMesh& m, double time, const ReclusterArguments& a) {
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
  return make_face_mesh(mesh.positions, mesh.indices);
}

int recluster(const ReclusterArguments& a) {
  const FaceMesh start = read_mesh(a.mesh);
  if (start.faces.empty()) fail_argument(a.mesh + " has no faces");
  std::filesystem::create_directories(a.out);
  FaceMesh now = start;
  std::vector<Colour> colours(start.faces.size());
  const auto save = [&](int frame, const std::vector<uint32_t>& labels) {
    for (size_t f = 0; f < labels.size(); ++f) colours[f] = label_colour(labels[f]);
    char name[32];
    std::snprintf(name, sizeof name, "frame_%04d", frame);
    const std::string base = (std::filesystem::path(a.out) / name).string();
    io::write_whole_file(base + ".ply", ply_of(now, colours));
    io::write_whole_file(base + ".png", png_of(draw_mesh(now, colours, a.width, a.height, a.z_up)));
  };
  if (a.method == "tree") {
    FaceClusterTree tree(start, {});
    for (int frame = 0; frame < a.frames; ++frame) {
      now.vertices = deformed(start, static_cast<double>(frame) / a.frames, a);
      std::vector<double> areas(now.faces.size());
      for (uint32_t f = 0; f < areas.size(); ++f) areas[f] = 0.5 * length(face_normal_area(now, f));
      const auto t = std::chrono::steady_clock::now();
      tree.set_weights(areas);
      std::printf("frame %d: %.2f ms, mean imbalance %.3f\n", frame, 1e3 * seconds_since(t),
                  tree.mean_imbalance(false));
      save(frame, tree.labels_at_level(a.level));
    }
    return 0;
  }
  FaceKmeansOptions o;
  o.clusters = a.clusters;
  FaceKmeans clusters(start, o);
  for (int frame = 0; frame < a.frames; ++frame) {
    now.vertices = deformed(start, static_cast<double>(frame) / a.frames, a);
    const auto t = std::chrono::steady_clock::now();
    if (frame > 0) clusters.move(now.vertices);
    const size_t iterations = clusters.run(frame > 0 ? 10 : 200);
    std::printf("frame %d: %.2f ms, %zu iterations, %zu clusters, %zu cut edges\n", frame, 1e3 * seconds_since(t),
                iterations, clusters.cluster_count(), clusters.cut_edges());
    save(frame, clusters.labels());
  }
  return 0;
}

int run(int argc, char** argv) {
  CLI::App app{"Geometry: hitting sets and epsilon-nets for disks, face clusters on deforming meshes"};
  app.require_subcommand(1);
  HittingArguments h;
  auto* hitting_command = app.add_subcommand("hitting-set", "Few points that hit every disk");
  hitting_command->add_option("--points", h.points, "CSV: x,y")->required();
  hitting_command->add_option("--disks", h.disks, "CSV: x,y,radius")->required();
  hitting_command->add_option("--out", h.out, "CSV of the chosen points: index,x,y (-: standard output)");
  hitting_command->add_option("--picture", h.picture, "Picture of the instance, .svg or .png");
  hitting_command->add_option("--size", h.size, "Its size in pixels")->check(CLI::Range(50, 10000));
  hitting_command->add_option("--method", h.method, "Solver")->check(CLI::IsMember({"default", "greedy", "dnet"}));
  hitting_command->add_flag("--drop-empty", h.drop_empty, "Leave out disks without points rather than refuse them");
  NetArguments n;
  auto* net_command = app.add_subcommand("net", "Points in every disk that holds at least epsilon of all points");
  net_command->add_option("--points", n.points, "CSV: x,y")->required();
  net_command->add_option("--epsilon", n.epsilon, "In (0, 1]");
  net_command->add_option("--out", n.out, "CSV of the chosen points (-: standard output)");
  net_command->add_flag("--thesis", n.thesis, "The thesis's construction rather than the certified one");
  ReclusterArguments r;
  auto* recluster_command = app.add_subcommand(
      "recluster", "Deforms a mesh and keeps its face clusters up; writes coloured PLY and PNG frames");
  recluster_command->add_option("mesh", r.mesh, "OBJ file")->required();
  recluster_command->add_option("--out", r.out, "Folder of the frames");
  recluster_command->add_option("--frames", r.frames, "How many")->check(CLI::Range(1, 100000));
  recluster_command->add_option("--method", r.method, "k-means clusters, or a level of the balanced tree")
      ->check(CLI::IsMember({"kmeans", "tree"}));
  recluster_command->add_option("--clusters", r.clusters, "Of k-means");
  recluster_command->add_option("--level", r.level, "Of the tree")->check(CLI::Range(0, 64));
  recluster_command->add_option("--reach", r.reach, "Of the deformation, in diagonals")->check(CLI::Range(1e-6, 100.0));
  recluster_command->add_option("--amount", r.amount, "Of the deformation, in diagonals")
      ->check(CLI::Range(0.0, 100.0));
  recluster_command->add_option("--width", r.width, "Of the pictures")->check(CLI::Range(16, 10000));
  recluster_command->add_option("--height", r.height, "Of the pictures")->check(CLI::Range(16, 10000));
  recluster_command->add_flag("--z-up", r.z_up, "The mesh stands along z");
  CLI11_PARSE(app, argc, argv);
  try {
    if (*hitting_command) return hitting_set(h);
    if (*net_command) return net(n);
    for (const auto& [name, value] :
         {std::pair{"--reach", r.reach}, {"--amount", r.amount}})  // CLI::Range lets NaN pass
      if (!std::isfinite(value)) fail_argument(std::string(name) + " is " + std::to_string(value));
    return recluster(r);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "lumicut-geometry: %s\n", e.what());
    return 1;
  }
}

}  // namespace
}  // namespace lumicut

int main(int argc, char** argv) {
  lumicut::io::open_standard_streams();
  return lumicut::io::close_standard_output("lumicut-geometry", lumicut::run(argc, argv), 1);
}
