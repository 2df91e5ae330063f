// Does the geometry of geometry/ pay in the renderer? Scenes come from LUMICUT_SCENES (or ../shared/scenes beside the
// project); without them nothing is measured. Figures and what follows from them: docs/benchmarks.md
//
//   bench_experiments [records [conference | kitchen] | separation [conference | kitchen] | faces [bunny | horse]]
#include <cstring>

#include "bench/experiments/experiments.h"
#include "bench/geometry/bench_util.h"

int main(int argc, char** argv) {
  using namespace lumicut::bench;
  const char* what = argc > 1 ? argv[1] : "all";
  const bool all = std::strcmp(what, "all") == 0;
  print_header("geometry in the renderer (all threads)", argc, argv, 1);
  bool known = false;
  const auto each = [&](const char* name, bool (*run)(const char*), const char* a, const char* b) {
    if (!all && std::strcmp(what, name) != 0) return;
    known = true;
    for (const char* scene : {a, b})
      if ((argc < 3 || std::strcmp(argv[2], scene) == 0) && !run(scene))
        std::printf("%s: %s is not in LUMICUT_SCENES; left out\n", name, scene);
  };
  each("records", records, "conference", "kitchen");
  each("separation", separation, "conference", "kitchen");
  each("faces", face_leaves, "bunny", "horse");
  if (!known) std::fprintf(stderr, "bench_experiments: no experiment \"%s\"\n", what);
  return known ? 0 : 2;
}
