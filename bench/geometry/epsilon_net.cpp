// Sizes and times of epsilon-nets: certified and thesis mode, against the thesis's Table 6.1.
#include <algorithm>
#include <cmath>
#include <vector>

#include "bench_util.h"
#include "geometry/epsilon_net.h"
#include "point_sets.h"

int main(int argc, char** argv) {
  using namespace lumicut;
  using namespace lumicut::bench;
  print_header("Epsilon-nets for disks: size times epsilon, seconds; heaviest unhit disk over epsilon n", argc, argv,
               1);
  std::printf("%-8s %8s %8s | %9s %8s %7s %8s | %9s %9s %8s %8s | %9s %9s %8s\n", "points", "n", "epsilon", "certified",
              "sample", "rounds", "seconds", "thesis 7", "sample", "unhit", "seconds", "thesis 12", "sample",
              "seconds");
  for (const char* kind : {"uniform", "gauss9"})
    for (const size_t n : {sized<size_t>(50000, 5000), sized<size_t>(1000000, 10000)})
      for (const double epsilon : {0.2, 0.1, 0.01, 0.001}) {
        if (n >= 1000000 && epsilon > 0.01) continue;
        if (smoke() && epsilon < 0.1) continue;
        const auto p = point_set(kind, n, 1);
        const double threshold = epsilon * static_cast<double>(n);
        EpsilonNet net[3];
        double seconds[3], unhit[3];
        for (int i = 0; i < 3; ++i) {
          EpsilonNetOptions o;
          o.seed = 1;
          o.mode = i == 0 ? EpsilonNetOptions::Mode::certified : EpsilonNetOptions::Mode::thesis;
          o.c0 = i == 2 ? 12 : 0;
          seconds[i] = time_of([&] { net[i] = epsilon_net(p, {}, epsilon, o); });
          unhit[i] = heaviest_unhit_disk(p, {}, net[i].points) / threshold;
        }
        const auto size = [&](int i) { return epsilon * static_cast<double>(net[i].points.size()); };
        const auto sample = [&](int i) { return epsilon * static_cast<double>(net[i].sample); };
        std::printf("%-8s %8zu %8g | %9.3f %8.3f %7zu %8.3f | %9.3f %9.3f %8.3f %8.3f | %9.3f %9.3f %8.3f%s\n", kind, n,
                    epsilon, size(0), sample(0), net[0].rounds, seconds[0], size(1), sample(1), unhit[1], seconds[1],
                    size(2), sample(2), seconds[2], std::max({unhit[0], unhit[1], unhit[2]}) < 1 ? "" : "  VIOLATION");
      }
}
