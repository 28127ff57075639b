#include <gtest/gtest.h>

#include <numeric>

#include "core/algorithm/linear/block/natural_levels.hpp"
#include "core/plan/block_factor_plan.hpp"
#include "tests/support/systems/box_scenes.hpp"

/// The plan of incomplete Cholesky that a kernel makes is the one that the host makes, number by number.
namespace {

using namespace stiction;
using namespace stiction::test;

std::vector<Index> table(const Index* data, Index count) {
  return {data, data + count};
}

void expect_the_hosts_plan(BlockSystem system) {
  const BlockPattern pattern = system.pattern();
  std::vector<Index> order(static_cast<std::size_t>(pattern.rows)), stream;
  std::iota(order.begin(), order.end(), 0);
  append_block_factor(stream, pattern, order, Fill::none);
  const Index* next = stream.data();
  const BlockFactorView host = take_block_factor(next);

  std::vector<Index> memory(static_cast<std::size_t>(NaturalLevels::integers(pattern.rows, pattern.blocks())));
  NaturalLevels levels;
  SerialTeam team;
  levels.make(team, pattern, memory.data());
  const BlockFactorView& own = levels.view;
  ASSERT_EQ(own.rows, host.rows);
  ASSERT_EQ(own.level_count, host.level_count);
  EXPECT_EQ(table(own.level_offsets, own.level_count + 1), table(host.level_offsets, host.level_count + 1));
  EXPECT_EQ(table(own.order, own.rows), table(host.order, host.rows));
  EXPECT_EQ(table(own.lower.offsets, own.rows + 1), table(host.lower.offsets, host.rows + 1));
  const Index blocks = host.lower.blocks(), below = blocks - host.rows;
  EXPECT_EQ(table(own.lower.columns, blocks), table(host.lower.columns, blocks));
  EXPECT_EQ(table(own.sources, blocks), table(host.sources, blocks));
  EXPECT_EQ(table(own.column_offsets, own.rows + 1), table(host.column_offsets, host.rows + 1));
  EXPECT_EQ(table(own.column_rows, below), table(host.column_rows, below));
  EXPECT_EQ(table(own.column_blocks, below), table(host.column_blocks, below));
}

TEST(NaturalLevels, AreTheHostsPlan) {
  expect_the_hosts_plan(box_matrix(box_tower(1), 1e-3));
  expect_the_hosts_plan(box_matrix(box_tower(9), 1e-3));
  expect_the_hosts_plan(box_matrix(box_wall(7, 5), 1e-3));
  expect_the_hosts_plan(box_matrix(box_pyramid(5), 1e-3));
  for (unsigned seed = 1; seed <= 5; ++seed) expect_the_hosts_plan(box_matrix(random_touching(seed, 30, 0.2), 1e-3));
}

}  // namespace
