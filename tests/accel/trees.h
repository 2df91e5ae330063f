// What every binary tree of a builder must be.
#pragma once

#include <gtest/gtest.h>

#include <span>
#include <vector>

#include "accel/bvh_build.h"

namespace lumicut::test {

// Each primitive in one leaf, leaves in order, each node reached once, boxes tight.
inline void expect_good_tree(const Tree& tree, std::span<const Aabb> boxes) {
  ASSERT_EQ(tree.nodes.size(), boxes.empty() ? 0 : 2 * boxes.size() - 1);
  ASSERT_EQ(tree.prims.size(), boxes.size());
  std::vector<int> seen(boxes.size(), 0), reached(tree.nodes.size(), 0);
  uint32_t next = 0;
  for (std::vector<uint32_t> stack{0}; !stack.empty() && !tree.nodes.empty();) {
    const TreeNode& node = tree.nodes[stack.back()];
    ++reached[stack.back()];
    stack.pop_back();
    if (node.leaf()) {
      ASSERT_EQ(node.count, 1u);
      EXPECT_EQ(node.first, next++);  // leaves from left to right
      const uint32_t prim = tree.prims[node.first];
      ++seen[prim];
      EXPECT_EQ(node.lo, boxes[prim].lo);
      EXPECT_EQ(node.hi, boxes[prim].hi);
      continue;
    }
    const TreeNode &l = tree.nodes[node.first], &r = tree.nodes[node.first + 1];
    EXPECT_EQ(node.lo, min(l.lo, r.lo));
    EXPECT_EQ(node.hi, max(l.hi, r.hi));
    stack.push_back(node.first + 1);
    stack.push_back(node.first);
  }
  for (const int count : seen) ASSERT_EQ(count, 1);
  for (const int count : reached) ASSERT_EQ(count, 1);
}

}  // namespace lumicut::test
