#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

#include "core/algorithm/articulated/robot_lists.hpp"

/// The tree of a solve of robots: that of the model is kept exactly where rows change nothing of it.
namespace stiction::test {
namespace {

using Types = LaneTypes<double>;

/// Rows over sets of degrees of freedom, with memory for their columns.
struct Rows {
  std::vector<SlotOf<Types>> slots;
  std::vector<std::vector<unsigned char>> columns;

  void add(const std::vector<Index>& dofs) {
    std::vector<unsigned char>& own = columns.emplace_back(2 * dofs.size());
    std::copy(dofs.begin(), dofs.end(), own.begin());
    SlotOf<Types> slot{};
    for (const Index dof : dofs) slot.dofs |= only<DofSet>(dof);
    slot.columns = static_cast<Index>(dofs.size());
    slot.dof = own.data();
    slots.push_back(slot);
  }
  [[nodiscard]] Index count() const { return static_cast<Index>(slots.size()); }
};

RobotTree tree_of(const std::vector<Index>& parents, Rows& rows) {
  RobotTree tree{};
  std::vector<DofSet> coupled;
  for (const Index parent : parents) coupled.push_back(parent < 0 ? DofSet{} : only<DofSet>(parent));
  SerialTeam alone;
  build_tree(alone, tree, static_cast<Index>(parents.size()), coupled.data(), rows.slots.data(), rows.count());
  return tree;
}

bool is_same(const RobotTree& a, const RobotTree& b) {
  bool same = a.dofs == b.dofs && a.entries == b.entries;
  for (Index k = 0; k < a.dofs; ++k) same = same && a.begin[k] == b.begin[k] && a.depth[k] == b.depth[k];
  for (Index e = 0; e < a.entries && same; ++e) same = a.ancestor[e] == b.ancestor[e];
  return same;
}

TEST(RobotTree, RowsOfOnePathKeepItAndOthersDoNot) {
  std::mt19937 random(1);
  const auto below = [&](Index end) { return static_cast<Index>(random() % static_cast<unsigned>(end)); };
  int kept = 0, changed = 0;
  for (int draw = 0; draw < 2000; ++draw) {
    std::vector<Index> parents;
    for (Index k = 0; k < 12; ++k) parents.push_back(below(3) == 0 ? below(k + 1) - 1 : k - 1);
    Rows none, rows, again;
    const RobotTree model = tree_of(parents, none);
    for (Index s = 1 + below(3); s > 0; --s) {
      std::vector<Index> dofs;
      const Index last = below(12);
      for (Index d = last; d >= 0; d = below(4) == 0 ? d - 1 : parents[static_cast<std::size_t>(d)])
        if (below(3) > 0) dofs.insert(dofs.begin(), d);
      rows.add(dofs);
      again.add(dofs);
    }
    const bool keeps = keeps_tree<Types>(model, rows.slots.data(), rows.count());
    EXPECT_EQ(keeps, is_same(model, tree_of(parents, again))) << "draw " << draw;
    if (keeps) {
      EXPECT_EQ(rows.columns, again.columns) << "draw " << draw;  // and depths
    }
    ++(keeps ? kept : changed);
  }
  EXPECT_GT(kept, 300);
  EXPECT_GT(changed, 300);
}

}  // namespace
}  // namespace stiction::test
