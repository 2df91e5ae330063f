// Stores a list of merges, bottom-up, as a Tree.
#include "accel/bvh/builders.h"

namespace lumicut {

void place_merges(const std::vector<Merge>& merges, std::span<const uint32_t> prims, std::span<const Aabb> boxes,
                  Tree& tree, SubtreeSlots at) {
  const auto n = static_cast<uint32_t>(prims.size());
  std::vector<uint32_t> counts(merges.size());
  std::vector<Aabb> joint(merges.size());
  const auto box = [&](uint32_t id) -> const Aabb& { return id < n ? boxes[prims[id]] : joint[id - n]; };
  const auto count = [&](uint32_t id) { return id < n ? 1u : counts[id - n]; };
  for (size_t i = 0; i < merges.size(); ++i) {
    joint[i] = merge(box(merges[i].left), box(merges[i].right));
    counts[i] = count(merges[i].left) + count(merges[i].right);
  }
  std::vector<std::pair<uint32_t, SubtreeSlots>> stack{{static_cast<uint32_t>(n + merges.size() - 1), at}};
  while (!stack.empty()) {
    const auto [id, place] = stack.back();
    stack.pop_back();
    TreeNode& node = tree.nodes[place.root];
    set_box(node, box(id));
    if (id < n) {
      node.first = place.first, node.count = 1;
      tree.prims[place.first] = prims[id];
      continue;
    }
    const Merge& m = merges[id - n];
    node.first = place.free, node.count = 0;
    const auto [left, right] = children_of(place, count(m.left));
    stack.push_back({m.right, right});
    stack.push_back({m.left, left});
  }
}

}  // namespace lumicut
