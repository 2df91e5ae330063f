#include "accel/bvh_build.h"

#include <algorithm>
#include <charconv>
#include <cstring>
#include <numeric>
#include <utility>

#include "accel/agglomerate.h"
#include "accel/bvh/builders.h"
#include "core/error.h"

namespace lumicut {
namespace {

constexpr size_t kAgglomeratedPrimitives = 4096;  // of Builder::binned_agglomerative: what a subtree holds at most

}  // namespace

BuildOptions build_options_of(const std::string& text) {
  if (text.empty()) return build_options_of(kDefaultBuilder);
  BuildOptions options;
  const size_t plus = text.find('+');
  const std::string name = text.substr(0, plus);
  constexpr std::pair<const char*, Builder> kNames[] = {
      {"agglomerative", Builder::agglomerative},     {"agglomerative-parallel", Builder::agglomerative_parallel},
      {"parallel", Builder::agglomerative_parallel}, {"binned-agglomerative", Builder::binned_agglomerative},
      {"buckets", Builder::binned_agglomerative},    {"binned", Builder::binned},
      {"binned-longest", Builder::binned_longest},   {"sweep", Builder::sweep}};
  bool known = false;
  for (const auto& [n, builder] : kNames)
    if (name == n) options.builder = builder, known = true;
  if (plus != std::string::npos && known) {
    // "reinsert", "reinsert:P" or "reinsert:PxN" in digits and a decimal point.
    const std::string rest = text.substr(plus + 1);
    float percent = 20.0f;
    int passes = 8;
    if (rest != "reinsert") {
      const char *at = rest.data() + std::min(rest.size(), std::strlen("reinsert:")), *end = rest.data() + rest.size();
      known = rest.rfind("reinsert:", 0) == 0;
      const auto share = std::from_chars(at, end, percent, std::chars_format::fixed);
      known = known && share.ec == std::errc();
      if (known && share.ptr != end) {
        const auto count = std::from_chars(share.ptr + 1, end, passes);
        known = *share.ptr == 'x' && count.ec == std::errc() && count.ptr == end;
      }
    }
    known = known && percent > 0.0f && percent <= 100.0f && passes > 0 && passes <= 1000;
    options.reinsert_share = percent / 100.0f;
    options.reinsert_passes = passes;
  }
  if (!known)
    fail_argument("builder '" + text +
                  "' is none of agglomerative, agglomerative-parallel, binned-agglomerative, binned, binned-longest, "
                  "sweep, with or without '+reinsert', "
                  "'+reinsert:PERCENT' or '+reinsert:PERCENTxPASSES'");
  return options;
}

Tree build_tree(std::span<const Aabb> boxes, const BuildOptions& options, Progress* progress) {
  Tree tree;
  if (boxes.empty()) return tree;
  tree.nodes = HugeArray<TreeNode>(2 * boxes.size() - 1);
  tree.prims.resize(boxes.size());
  if (boxes.size() == 1) {
    set_box(tree.nodes[0], boxes[0]);
    tree.nodes[0].first = 0, tree.nodes[0].count = 1;
    return tree;
  }
  int depth = 0;  // 0: not known
  switch (options.builder) {
    case Builder::agglomerative:
    case Builder::agglomerative_parallel: {
      std::vector<uint32_t> prims(boxes.size());
      std::iota(prims.begin(), prims.end(), 0u);
      const Strategy strategy =
          options.builder == Builder::agglomerative_parallel ? Strategy::parallel : Strategy::locally_ordered;
      depth = place_merges(agglomerate_boxes(boxes, strategy, progress), prims, boxes, tree, {0, 1, 0});
      break;
    }
    case Builder::binned_agglomerative:
      build_binned(boxes, true, kAgglomeratedPrimitives, tree, progress);
      break;
    case Builder::binned:
      build_binned(boxes, true, 0, tree, progress);
      break;
    case Builder::binned_longest:
      build_binned(boxes, false, 0, tree, progress);
      break;
    case Builder::sweep:
      build_sweep(boxes, tree, progress);
      break;
  }
  if (options.reinsert_passes > 0 && options.reinsert_share > 0.0f && boxes.size() > 4) {
    optimize_by_reinsertion(tree, options.reinsert_share, options.reinsert_passes, progress);
    return in_depth_first_order(tree, boxes);
  }
  if ((depth > 0 ? depth : depth_of(tree)) >= kMaxTreeDepth) tree = in_depth_first_order(tree, boxes);
  return tree;
}

TreeCost cost_of(const Tree& tree) {
  TreeCost cost;
  if (tree.nodes.empty()) return cost;
  cost.depth = depth_of(tree);
  const double root = half_area(tree.nodes[0]);
  cost.boxes = 1;
  for (const TreeNode& node : tree.nodes) {
    const double p = root > 0 ? half_area(node) / root : 1.0;
    if (node.leaf())
      cost.tris += node.count * p;
    else
      cost.boxes += 2 * p;
  }
  cost.cost = 0.5 * cost.boxes + cost.tris;
  return cost;
}

}  // namespace lumicut
