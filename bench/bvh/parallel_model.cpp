// What the parallel exact builder could gain on more cores than there are: its chunks of work, counted on one thread,
// and laid out on P cores. Counts are of searched blocks of eight clusters, the same on every machine; times are of the
// thread's processor clock.
#include <time.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <queue>
#include <vector>

#include "accel/agglomerate.h"
#include "bench/bvh/meshes.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "bench/bvh/parallel_model.cpp"
#include <hwy/foreach_target.h>
// foreach_target comes first.
#include <hwy/highway.h>

#include "accel/agglomerate-inl.h"
#include "accel/agglomerate/area_policy-inl.h"

#ifndef LUMICUT_BENCH_BVH_SCHEDULE
#define LUMICUT_BENCH_BVH_SCHEDULE
namespace lumicut::bench {

constexpr int kCores[] = {1, 2, 4, 8, 16, 32, 64};

// Of one build: blocks and seconds on so many cores, and how they part.
struct Layout {
  double blocks[std::size(kCores)] = {}, seconds[std::size(kCores)] = {};
  double in_regions = 0, regions_seconds = 0, sort_seconds = 0, other_chunks_seconds = 0, serial_seconds = 0;
};

class Schedule {
 public:
  uint64_t blocks = 0;  // searched so far

  void begin_section() { serial(), chunks_.clear(); }
  void end_chunk() {
    chunks_.push_back(taken());
    mark();
  }
  // Chunks go to the first core that is free, in order, as a work-stealing scheduler's do but for its grain.
  void end_section() {
    double all = 0, seconds = 0;
    for (const Work& w : chunks_) all += w.blocks, seconds += w.seconds;
    (all > 0 ? out_.regions_seconds : (sorting_ ? out_.sort_seconds : out_.other_chunks_seconds)) += seconds;
    out_.in_regions += all;
    for (size_t k = 0; k < std::size(kCores); ++k) {
      out_.blocks[k] += makespan(kCores[k], &Work::blocks);
      out_.seconds[k] += makespan(kCores[k], &Work::seconds);
    }
    mark();
  }
  // Sections in between are of sorting.
  void begin_sort() { sorting_ = true; }
  void end_sort() { sorting_ = false; }
  void start() { mark(); }
  Layout finish() {
    serial();
    return out_;
  }

 private:
  struct Work {
    double blocks, seconds;
  };
  static double now() {
    timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
  }
  void mark() { at_ = {static_cast<double>(blocks), now()}; }
  Work taken() const { return {static_cast<double>(blocks) - at_.blocks, now() - at_.seconds}; }
  void serial() {
    const Work w = taken();
    out_.serial_seconds += w.seconds;
    for (size_t k = 0; k < std::size(kCores); ++k) out_.blocks[k] += w.blocks, out_.seconds[k] += w.seconds;
    mark();
  }
  double makespan(int cores, double Work::*of) const {
    std::priority_queue<double, std::vector<double>, std::greater<>> free;
    for (int i = 0; i < cores; ++i) free.push(0);
    double last = 0;
    for (const Work& w : chunks_) {
      const double end = free.top() + w.*of;
      free.pop(), free.push(end);
      last = std::max(last, end);
    }
    return last;
  }
  Work at_{};
  bool sorting_ = false;
  std::vector<Work> chunks_;
  Layout out_;
};

}  // namespace lumicut::bench
#endif

HWY_BEFORE_NAMESPACE();
namespace lumicut {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

// The policy of boxes, which counts.
struct CountedBoxes : agglomeration::AreaPolicy {
  explicit CountedBoxes(bench::Schedule* counts) : to(counts) {}
  bench::Schedule* to;
  bench::Schedule& schedule() const { return *to; }
  template <class D>
  HWY_INLINE hn::Vec<D> cost(D d, const Query<D>& a, const float* b) const {
    to->blocks += hn::Lanes(d);
    return AreaPolicy::cost(d, a, b);
  }
};
static_assert(agglomeration::ClusterPolicy<CountedBoxes>);

bench::Layout lay_out(std::span<const Aabb> boxes) {
  bench::Schedule schedule;
  const CountedBoxes policy(&schedule);
  agglomeration::Core<CountedBoxes> core(policy, boxes.size(), false, nullptr);
  schedule.start();
  core.for_chunks(boxes.size(), 4096, [&](size_t begin, size_t end) {
    for (size_t i = begin; i < end; ++i)
      for (int axis = 0; axis < 3; ++axis) {
        core.leaf(i)[axis] = -boxes[i].lo[axis];
        core.leaf(i)[3 + axis] = boxes[i].hi[axis];
      }
  });
  core.run(Strategy::parallel);
  return schedule.finish();
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace lumicut
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace lumicut {
HWY_EXPORT(lay_out);
}  // namespace lumicut

int main(int argc, char** argv) {
  using namespace lumicut;
  using namespace lumicut::bench;
  CLI::App app("The parallel exact builder on more cores, from counts on one thread");
  std::vector<std::string> names{"conference", "kitchen", "sponza", "soup"};
  app.add_option("--meshes", names, "scenes of LUMICUT_SCENES, or soup, scan, house");
  CLI11_PARSE(app, argc, argv);
  const std::string folder = scenes_folder();
  std::printf(
      "Blocks: searched, millions, of which in regions. Gains by blocks are counts; those by seconds lay measured "
      "chunks "
      "out. Parts of the seconds on one core: regions, sorting, other chunks, one after the other.\n\n"
      "| mesh | triangles | blocks | in regions | parts of seconds |");
  for (const int cores : kCores)
    if (cores > 1) std::printf(" %d: blocks | seconds |", cores);
  std::printf("\n|---|---|---|---|---|");
  for (size_t k = 1; k < std::size(kCores); ++k) std::printf("---|---|");
  std::printf("\n");
  for (const std::string& name : names) {
    BenchMesh mesh = name == "soup"    ? soup(sized(200000, 20000), 1)
                     : name == "scan"  ? scan(sized(100000, 1000))
                     : name == "house" ? house(sized(300000, 1000), 1)
                     : folder.empty()  ? BenchMesh()
                                       : load_obj(folder, name);
    if (mesh.indices.empty()) {
      std::printf("\n(%s is left out: not found; LUMICUT_SCENES names the folder of scenes)\n", name.c_str());
      continue;
    }
    std::vector<Aabb> boxes(mesh.triangles());
    for (size_t i = 0; i < mesh.indices.size(); ++i) boxes[i / 3].extend(mesh.positions[mesh.indices[i]]);
    const Layout l = HWY_DYNAMIC_DISPATCH(lay_out)(boxes);
    const double s = l.seconds[0];
    std::printf("| %s | %zu | %.1f M | %.0f %% | %.0f, %.0f, %.0f, %.0f %% |", name.c_str(), boxes.size(),
                l.blocks[0] / 8e6, 100 * l.in_regions / l.blocks[0], 100 * l.regions_seconds / s,
                100 * l.sort_seconds / s, 100 * l.other_chunks_seconds / s, 100 * l.serial_seconds / s);
    for (size_t k = 1; k < std::size(kCores); ++k)
      std::printf(" %.2fx | %.2fx |", l.blocks[0] / l.blocks[k], s / l.seconds[k]);
    std::printf("\n");
    std::fflush(stdout);
  }
}
#endif
