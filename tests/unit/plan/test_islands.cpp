#include "core/base/extents.hpp"
#include "core/plan/islands.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>
#include <utility>
#include <vector>

#include "core/algorithm/plan/islands.hpp"
#include "tests/support/machines/stress_team.hpp"
#include "tests/support/systems/random_structures.hpp"

/// Islands found by the host and by bodies on blocks of several widths, against answers by hand and by brute force.
namespace {

using namespace stiction;
using namespace stiction::test;

/// Cones of one row, entries only where named: (row, column).
Environment<double> rows_joined(int rows, std::vector<std::pair<Index, Index>> entries,
                                const std::vector<Index>& groups = {}) {
  Environment<double> env;
  std::sort(entries.begin(), entries.end());
  for (Index row = 0; row < rows; ++row) {
    env.cones.push_back({ConeKind::unilateral, 1, groups.empty() ? -1 : groups[at(row)]});
    for (const auto& [i, j] : entries)
      if (i == row) env.column.push_back(j);
    env.row_offsets.push_back(static_cast<Index>(env.column.size()));
  }
  env.b.resize(at(rows));
  env.A.resize(env.column.size());
  return env;
}

/// Returns the body's result on so many lanes; shapes as the host's.
Islands islands_by_body(const ContactBatchView<double>& batch, Index lanes) {
  Islands islands{std::vector<Index>(at(batch.cone_count)), std::vector<Index>(at(batch.env_count))};
  for (Offset env = 0; env < batch.env_count; ++env) {
    const StructureView s = structure_of(batch, env);
    std::vector<Index> scratch(at(islands_scratch_elements(s.rows, s.cones, s.entry_span())), 0x7eadbeef);
    Index* const island = islands.island.data() + batch.env_cone_offsets[env];
    const auto number = [&](auto& team) {
      const Index count = number_islands(team, s, island, scratch.data());
      single(team, [&] { islands.count[at(env)] = count; });
    };
    if (lanes > 1) {
      run_stressed<1>(lanes, number);
    } else {
      SerialTeam team;
      number(team);
    }
  }
  return islands;
}

void expect_islands(const ContactBatchView<double>& batch, const Islands& expected,
                    std::initializer_list<Index> widths) {
  const Islands host = find_islands(batch);
  EXPECT_EQ(host.island, expected.island);
  EXPECT_EQ(host.count, expected.count);
  for (const Index lanes : widths) {
    const Islands body = islands_by_body(batch, lanes);
    EXPECT_EQ(body.island, expected.island) << lanes << " lanes";
    EXPECT_EQ(body.count, expected.count) << lanes << " lanes";
  }
}

/// Cones reached from each cone, by going over all pairs until nothing is added.
Islands by_brute_force(const ContactBatchView<double>& batch) {
  Islands islands{std::vector<Index>(at(batch.cone_count), 0), {}};
  for (Offset env = 0; env < batch.env_count; ++env) {
    const Offset first = batch.env_cone_offsets[env], first_row = batch.env_row_offsets[env];
    const Index cones = batch.env_cones(env);
    const auto cone_of = [&](Offset row) {
      Index cone = 0;
      while (batch.cone_row_offsets[first + cone + 1] <= row) ++cone;
      return cone;
    };
    std::vector<Index> smallest(at(cones));
    std::iota(smallest.begin(), smallest.end(), 0);
    for (bool changed = true; changed;) {
      changed = false;
      const auto join = [&](Index a, Index b) {
        const Index least = std::min(smallest[at(a)], smallest[at(b)]);
        changed = changed || smallest[at(a)] != least || smallest[at(b)] != least;
        smallest[at(a)] = smallest[at(b)] = least;
      };
      for (Index cone = 1; cone < cones && batch.cone_group != nullptr; ++cone)
        if (const Index group = batch.cone_group[first + cone];
            group >= 0 && group == batch.cone_group[first + cone - 1])
          join(cone - 1, cone);
      for (Offset row = first_row; row < first_row + batch.env_rows(env); ++row)
        for (Index k = 0; k < batch.row_entries(row); ++k)
          join(cone_of(row), cone_of(first_row + batch.row_columns(row)[k]));
    }
    std::vector<Index> firsts(smallest);
    std::sort(firsts.begin(), firsts.end());
    firsts.erase(std::unique(firsts.begin(), firsts.end()), firsts.end());
    for (Index cone = 0; cone < cones; ++cone) {
      const auto place = std::find(firsts.begin(), firsts.end(), smallest[at(cone)]);
      islands.island[at(first + cone)] = static_cast<Index>(place - firsts.begin());
    }
    islands.count.push_back(static_cast<Index>(firsts.size()));
  }
  return islands;
}

TEST(Islands, AreNumberedByTheirFirstCones) {
  ContactBatch<double> batch;
  batch.add(rows_joined(6, {{5, 1}, {2, 0}, {4, 4}}));  // 0-2 | 1-5 | 3 | 4
  batch.add({});
  batch.add(rows_joined(3, {{0, 2}}));  // stored on one side only
  expect_islands(batch.view(), {{0, 1, 0, 2, 3, 1, 0, 1, 0}, {4, 0, 2}}, {1, 3});
}

TEST(Islands, ManifoldsHoldTheirConesTogetherButNoOthers) {
  ContactBatch<double> batch;
  batch.add(rows_joined(7, {{6, 0}}, {7, 7, -1, -1, 7, 7, 7}));  // two manifolds of one id, joined
  batch.add(rows_joined(2, {}, {3, 4}));
  expect_islands(batch.view(), {{0, 0, 1, 2, 0, 0, 0, 0, 1}, {3, 2}}, {1, 2});
}

TEST(Islands, AnEmptyBatchHasNone) {
  const Islands islands = find_islands(ContactBatch<double>().view());
  EXPECT_TRUE(islands.island.empty());
  EXPECT_TRUE(islands.count.empty());
}

// One chain through all cones, numbered at random: labels wander for longer than they are given, in either direction.
TEST(Islands, ALongChainInDisorderIsOneIsland) {
  constexpr int kCones = 3000;
  std::vector<Index> number(kCones);
  std::iota(number.begin(), number.end(), 0);
  for (const bool in_order : {true, false}) {
    if (!in_order) std::shuffle(number.begin(), number.end(), std::mt19937(5));
    std::vector<std::pair<Index, Index>> entries;
    for (int c = 1; c < kCones; ++c)
      if (c != kCones / 2) entries.emplace_back(number[at(c - 1)], number[at(c)]);
    ContactBatch<double> batch;
    batch.add(rows_joined(kCones, entries));
    std::vector<Index> island(kCones);
    for (int c = 0; c < kCones; ++c) island[at(number[at(c)])] = c < kCones / 2 ? 0 : 1;
    if (island[0] == 1)
      for (Index& i : island) i = 1 - i;
    expect_islands(batch.view(), {island, {2}}, {1, 2, 8});
  }
}

TEST(Islands, AreThoseOfBruteForce) {
  std::mt19937 random(31);
  std::vector<Index> counts;
  for (int round = 0; round < 400 && !testing::Test::HasFailure(); ++round) {
    SCOPED_TRACE("batch " + std::to_string(round));
    const ContactBatch<double> batch = random_structures(random);
    const Islands expected = by_brute_force(batch.view());
    if (round % 10 == 0) {
      expect_islands(batch.view(), expected, {1, 2, 3, 8});
    } else {
      expect_islands(batch.view(), expected, {1});
    }
    const Integers wide = with_room(batch.view(), random);
    expect_islands(wide.view(), by_brute_force(wide.view()), {1});
    EXPECT_EQ(find_islands(wide.view()).count, expected.count);
    counts.insert(counts.end(), expected.count.begin(), expected.count.end());
  }
  EXPECT_GT(std::count_if(counts.begin(), counts.end(), [](Index count) { return count > 1; }), 200);
  EXPECT_GT(std::count(counts.begin(), counts.end(), 1), 50);
}

}  // namespace
