// Hitting sets for disks on the rows of the thesis's Table 7.1 that can be generated, beside greedy, dnet and an
// integer-programming solver (COIN-OR CBC, when its command is installed) on the reduced instance.
//
//   bench_hitting_set            the table
//   bench_hitting_set scale      dnet to a million points, and the memory-bounded path
//   bench_hitting_set local      local search alone by the size of exchanges, on the tight instance and on random ones
//   bench_hitting_set reports    memory and reports of dnet (Table 7.2), by kd-tree and by Delaunay triangulations
//   bench_hitting_set <n>        the table with n seconds for each integer program (default 60)
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <numeric>
#include <string>
#include <vector>

#include "bench_util.h"
#include "geometry/hitting_instance.h"
#include "geometry/hitting_set.h"
#include "geometry/independent_set.h"
#include "point_sets.h"
#ifdef LUMICUT_HAS_CGAL
#include "geometry/dnet.h"
#endif

namespace lumicut::bench {
namespace {

struct Case {
  const char* points;
  size_t n;
  const char*
      kind;  // RND: random disks, radius uniform in [0, r], those without points dropped; FIX: one around each point
  size_t disks;
  double r;
};

std::vector<Disk> make_disks(const Case& c, const std::vector<Point2>& p) {
  return std::strcmp(c.kind, "FIX") == 0 ? fixed_disks(p, c.r) : random_disks(p, c.disks, c.r, 2);
}

struct Proof {
  double bound = 0, value = 0;
  bool optimal = false, ran = false;
  double seconds = 0;
};

// min sum x over the kernel's disks, by the cbc command.
Proof integer_program(const hitting::Instance& in, int seconds) {
  Proof proof;
  const std::string base = "/tmp/lumicut_cbc_" + std::to_string(getpid());
  {
    std::ofstream lp(base + ".lp");
    lp << "Minimize\n obj:";
    for (size_t p = 0; p < in.point_id.size(); ++p) lp << (p % 20 ? " + x" : "\n + x") << p;
    lp << "\nSubject To\n";
    for (size_t d = 0; d < in.disk_id.size(); ++d) {
      lp << " c" << d << ":";
      size_t k = 0;
      for (const uint32_t p : in.points_of[d]) lp << (k++ % 20 == 19 ? "\n + x" : " + x") << p;
      lp << " >= 1\n";
    }
    lp << "Binary\n";
    for (size_t p = 0; p < in.point_id.size(); ++p) lp << " x" << p << "\n";
    lp << "End\n";
  }
  // cbc looks at its clock between phases only: timeout ends it where a phase takes for ever.
  const std::string command = "timeout " + std::to_string(3 * seconds) + " cbc " + base + ".lp sec " +
                              std::to_string(seconds) + " solve > " + base + ".log 2>/dev/null";
  proof.ran = std::system(command.c_str()) == 0;
  std::string line;
  for (std::ifstream log(base + ".log"); std::getline(log, line);) {
    if (line.find("Optimal solution found") != std::string::npos) proof.optimal = true;
    if (line.rfind("Objective value:", 0) == 0) proof.value = std::atof(line.c_str() + 16);
    if (line.rfind("Lower bound:", 0) == 0) proof.bound = std::atof(line.c_str() + 12);
    if (line.rfind("Time (CPU seconds):", 0) == 0) proof.seconds = std::atof(line.c_str() + 19);
  }
  if (proof.optimal) proof.bound = proof.value;
  proof.ran = proof.ran && proof.value > 0;
  std::remove((base + ".lp").c_str());
  std::remove((base + ".log").c_str());
  return proof;
}

int table(int seconds) {
  std::printf("# optimum: '=' proven by cbc on the reduced instance within %d s; else its bounds; bound: ours\n",
              seconds);
  std::printf("%-8s %7s %-9s %7s | %15s %7s | %7s %7s %7s %7s %7s %8s %7s | %7s %7s %7s\n", "points", "n", "disks",
              "number", "optimum", "s", "greedy", "pruned", "k-start", "default", "bound", "x opt", "s", "dnet",
              "x opt", "s");
  const Case cases[] = {{"uniform", 50000, "RND", 50000, 0.1},   {"gauss9", 50000, "RND", 50000, 0.1},
                        {"uniform", 50000, "RND", 500000, 0.01}, {"gauss9", 50000, "RND", 500000, 0.01},
                        {"uniform", 50000, "FIX", 0, 0.001},     {"gauss9", 50000, "FIX", 0, 0.001},
                        {"uniform", 20000, "FIX", 0, 0.01},      {"uniform", 20000, "FIX", 0, 0.02}};
  for (Case c : cases) {
    if (smoke()) c.n /= 50, c.disks /= 50, c.r *= 7;  // as many points a disk
    const auto p = point_set(c.points, c.n, 1);
    const auto disks = make_disks(c, p);
    std::vector<uint32_t> all(disks.size());
    std::iota(all.begin(), all.end(), 0u);
    const size_t greedy = greedy_hitting_set(p, disks, false).size(),
                 pruned = greedy_hitting_set(p, disks, true).size();
    HittingSet h;
    const double s = time_of([&] { h = solve_hitting_set(p, disks); });
    const bool valid = unhit_disks(p, disks, h.points).empty();
    Proof proof;
    {
      const hitting::Kernel kernel = hitting::reduce(hitting::make_instance(PointTree(p), disks, all));
      proof = integer_program(kernel.instance, seconds);
    }
    const double optimum = proof.optimal ? proof.value : std::max(proof.bound, static_cast<double>(h.lower_bound));
    char text[64];
    if (proof.optimal)
      std::snprintf(text, sizeof text, "= %.0f", proof.value);
    else
      std::snprintf(text, sizeof text, "%.0f..%.0f", std::ceil(optimum - 1e-6), proof.value);
    std::printf("%-8s %7zu %-3s %-5g %7zu | %15s %7.1f | %7zu %7zu %7zu %7zu %7zu %8.4f %7.2f |", c.points, c.n, c.kind,
                c.r, disks.size(), proof.ran ? text : "not solved", proof.seconds, greedy, pruned, h.pruned,
                h.points.size(), h.lower_bound, static_cast<double>(h.points.size()) / optimum, s);
#ifdef LUMICUT_HAS_CGAL
    DnetResult d;
    const double t = time_of([&] { d = dnet_hitting_set(p, disks); });
    std::printf(" %7zu %7.3f %7.2f", d.points.size(), static_cast<double>(d.points.size()) / optimum, t);
    if (!unhit_disks(p, disks, d.points).empty()) std::printf(" DNET LEAVES DISKS UNHIT");
#endif
    std::printf("%s\n", valid ? "" : " LEAVES DISKS UNHIT");
    std::fflush(stdout);
  }
  return 0;
}

// Runs fn in a process of its own, so that peak memory is its own.
template <typename Fn>
void apart(Fn&& fn) {
  std::fflush(stdout);
  const pid_t child = fork();
  if (child == 0) {
    fn();
    std::fflush(stdout);
    _exit(0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  if (status != 0) std::exit(1);
}

int scale() {
  std::printf("%-44s %9s %9s %9s %9s %9s\n", "instance", "set", "bound", "seconds", "us/(n+m)", "peak MB");
#ifdef LUMICUT_HAS_CGAL
  for (size_t n : {62500, 125000, 250000, 500000, 1000000})
    apart([&] {
      n /= sized(1, 200);
      const Case c{"uniform", n, "RND", n, 0.1 * std::sqrt(50000.0 / static_cast<double>(n))};
      const auto p = point_set(c.points, n, 1);
      const auto disks = make_disks(c, p);
      DnetResult d;
      DnetOptions o;
      o.net.mode = EpsilonNetOptions::Mode::thesis;  // larger nets, and ten times as fast
      const double s = time_of([&] { d = dnet_hitting_set(p, disks, o); });
      std::printf("dnet  %7zu points %7zu disks RND %-8.4f %9zu %9s %9.2f %9.2f %9.0f\n", n, disks.size(), c.r,
                  d.points.size(), "-", s, 1e6 * s / static_cast<double>(n + disks.size()), peak_megabytes());
    });
#endif
  const auto many = sized<size_t>(400000, 2000);
  for (const bool bounded : {false, true})
    apart([&] {
      const Case c{"uniform", many, "FIX", 0, bounded ? 0.058 : 0.003};
      const auto p = point_set(c.points, c.n, 1);
      const auto disks = make_disks(c, p);
      HittingSetOptions o;
      o.max_incidences = size_t{1} << (bounded ? sized(22, 12) : 27);
      HittingSet h;
      const double s = time_of([&] { h = solve_hitting_set(p, disks, o); });
      std::printf("%-8s %zu points and disks FIX %-11.3f %9zu %9zu %9.2f %9.2f %9.0f%s\n",
                  bounded ? "bounded" : "default", many, c.r, h.points.size(), h.lower_bound, s,
                  1e6 * s / (2 * static_cast<double>(many)), peak_megabytes(),
                  unhit_disks(p, disks, h.points).empty() ? "" : " LEAVES DISKS UNHIT");
    });
#ifdef LUMICUT_HAS_CGAL
  apart([&] {
    const Case c{"uniform", many, "FIX", 0, 0.058};
    const auto p = point_set(c.points, c.n, 1);
    const auto disks = make_disks(c, p);
    DnetResult d;
    DnetOptions o;
    o.net.mode = EpsilonNetOptions::Mode::thesis;
    const double s = time_of([&] { d = dnet_hitting_set(p, disks, o); });
    std::printf("dnet     %zu points and disks FIX %-11.3f %9zu %9s %9.2f %9.2f %9.0f\n", many, c.r, d.points.size(),
                "-", s, 1e6 * s / (2 * static_cast<double>(many)), peak_megabytes());
  });
#endif
  return 0;
}

int reports() {
#ifdef LUMICUT_HAS_CGAL
  std::printf("%-8s %-9s %7s | %7s %7s %8s %8s | %8s %8s %8s\n", "points", "disks", "number", "set", "s kd", "MB kd",
              "s Delau", "MB Delau", "total", "doubling");
  for (const char* family : {"uniform", "gauss9"})
    for (const Case& c : {Case{family, 50000, "RND", 500000, 0.01}, Case{family, 50000, "RND", 50000, 0.1},
                          Case{family, 50000, "FIX", 0, 0.001}}) {
      const auto p = point_set(c.points, c.n / sized<size_t>(1, 50), 1);
      const auto disks = make_disks(c, p);
      for (const auto structures : {DnetOptions::Structures::kd_tree, DnetOptions::Structures::delaunay})
        apart([&] {
          const double before = peak_megabytes();
          DnetOptions o;
          o.net.mode = EpsilonNetOptions::Mode::thesis;
          o.net.c0 = 10;  // the thesis's
          o.structures = structures;
          DnetResult d;
          const double s = time_of([&] { d = dnet_hitting_set(p, disks, o); });
          if (structures == DnetOptions::Structures::kd_tree)
            std::printf("%-8s %-3s %-5g %7zu | %7zu %7.2f %8.1f", c.points, c.kind, c.r, disks.size(), d.points.size(),
                        s, peak_megabytes() - before);
          else
            std::printf(" %7.2f %8.1f | %8zu %8zu\n", s, peak_megabytes() - before, d.reports, d.reweighed);
        });
    }
#endif
  return 0;
}

int local() {
  std::printf("%-34s %8s %8s %8s | %8s %7s | %8s %7s | %8s %7s\n", "instance", "number", "at most", "start", "(2,1)",
              "s", "(3,2)", "s", "(4,3)", "s");
  // `most`: exchanges of four around many points that share disks take hours.
  const auto row = [](const std::string& name, size_t number, size_t best, size_t start, int most, auto&& improved) {
    std::printf("%-34s %8zu %8zu %8zu", name.c_str(), number, best, start);
    for (int k = 2; k <= most; ++k) {
      size_t size = 0;
      const double s = time_of([&] { size = improved(k); });
      std::printf(" | %8zu %7.2f", size, s);
    }
    std::printf("\n");
    std::fflush(stdout);
  };
  for (const int side : {10, 30, 100}) {
    if (smoke() && side > 10) break;
    const TightInstance t = tight_instance(side);
    row("hit: tight, side " + std::to_string(side), t.disks.size(), t.small, t.start.size(), 4,
        [&](int k) { return improve_hitting_set(t.points, t.disks, t.start, k).size(); });
  }
  for (const double r : {0.01, 0.02}) {
    const auto p = uniform_points(sized<size_t>(20000, 200), 1);
    const auto disks = fixed_disks(p, r * sized(1, 10));
    const auto start = greedy_hitting_set(p, disks, true);
    row("hit: uniform 20K, FIX " + std::to_string(r).substr(0, 4), disks.size(),
        solve_hitting_set(p, disks).points.size(), start.size(), r < 0.015 ? 4 : 3,
        [&](int k) { return improve_hitting_set(p, disks, start, k).size(); });
  }
  for (const double r : {0.1, 0.01}) {
    const auto p = uniform_points(sized<size_t>(50000, 500), 1);
    const auto disks = random_disks(p, sized<size_t>(50000, 500), r, 2);
    // What small ones first gives.
    std::vector<uint32_t> order(disks.size()), start;
    std::iota(order.begin(), order.end(), 0u);
    std::stable_sort(order.begin(), order.end(),
                     [&](uint32_t a, uint32_t b) { return disks[a].radius < disks[b].radius; });
    for (const uint32_t d : order)
      if (std::none_of(start.begin(), start.end(), [&](uint32_t e) {
            const double sum = disks[d].radius + disks[e].radius;
            return dist2(disks[d].centre, disks[e].centre) <= sum * sum;
          }))
        start.push_back(d);
    row("independent: RND " + std::to_string(r).substr(0, 4), disks.size(), 0, start.size(), 4,
        [&](int k) { return independent_disks(disks, k).size(); });
  }
  return 0;
}

}  // namespace
}  // namespace lumicut::bench

int main(int argc, char** argv) {
  lumicut::bench::print_header("Hitting sets for disks", argc, argv, 1);
  if (argc > 1 && !std::strcmp(argv[1], "scale")) return lumicut::bench::scale();
  if (argc > 1 && !std::strcmp(argv[1], "local")) return lumicut::bench::local();
  if (argc > 1 && !std::strcmp(argv[1], "reports")) return lumicut::bench::reports();
  return lumicut::bench::table(argc > 1 ? std::max(1, std::atoi(argv[1])) : 60);
}
