#include "core/algorithm/plan/plan_environment.hpp"
#include "core/base/extents.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <numeric>
#include <random>
#include <set>
#include <vector>

#include "core/plan/plan.hpp"
#include "core/runtime/check/defects.hpp"
#include "tests/support/machines/stress_team.hpp"
#include "tests/support/systems/random_structures.hpp"

/// A plan made by any number of lanes holds the integers of make_plan(), which tests/unit/plan/test_plan.cpp
/// tests.
namespace {

using namespace stiction;
using namespace stiction::test;

/// Runs f(team) on a block of so many lanes.
template <class F>
void on_lanes(Index lanes, F&& f) {
  if (lanes > 1) return run_stressed<1>(lanes, f);
  SerialTeam team;
  f(team);
}

/// Environments planned one by one into arrays as a device has them: room for every cone in each.
struct BodyPlan {
  BodyPlan(const ContactBatchView<double>& batch, Index lanes)
      : path(at(batch.env_count), static_cast<EnvPath>(77)),
        counts(at(batch.env_count)),
        cone_order(at(batch.cone_count), kUnwritten),
        vertex_offsets(at(batch.cone_count + batch.env_count), kUnwritten),
        color_offsets(vertex_offsets),
        color_count(at(batch.env_count), kUnwritten) {
    for (Offset env = 0; env < batch.env_count; ++env) {
      const StructureView s = structure_of(batch, env);
      SerialTeam alone;
      const bool sparse = path_of(alone, s) == EnvPath::sparse;
      // As long as promised and full of nonsense: reads before writes show, and so do writes behind
      // it.
      std::vector<Index> scratch(sparse ? at(plan_scratch_elements(s.rows, s.cones, s.entry_span())) : 0, 0x7eadbeef);
      const Offset cone = batch.env_cone_offsets[env];
      const PlanTarget target{&path[at(env)],
                              &counts[at(env)],
                              cone_order.data() + cone,
                              vertex_offsets.data() + cone + env,
                              color_offsets.data() + cone + env,
                              &color_count[at(env)]};
      on_lanes(lanes, [&](auto& team) { plan_environment(team, s, target, scratch.data()); });
    }
  }

  static constexpr Index kUnwritten = -77;
  std::vector<EnvPath> path;
  std::vector<ConeCounts> counts;
  std::vector<Index> cone_order, vertex_offsets, color_offsets, color_count;
};

std::vector<Index> part(const std::vector<Index>& values, Offset begin, Offset count) {
  return {values.begin() + begin, values.begin() + begin + count};
}

/// Expected arrays of an environment: the host's entries, the rest of the room as it was.
std::vector<Index> in_room(const std::vector<Index>& values, Offset begin, Offset end, Offset room) {
  std::vector<Index> result = part(values, begin, end - begin);
  result.resize(at(room), BodyPlan::kUnwritten);
  return result;
}

void expect_plan(const ContactBatchView<double>& batch, Index lanes, int& sparse) {
  const PlanData host = make_plan(batch);
  const BodyPlan body(batch, lanes);
  ASSERT_EQ(body.path, host.path);
  EXPECT_EQ(body.color_count, host.color_count);
  for (Offset env = 0; env < batch.env_count; ++env) {
    SCOPED_TRACE("env " + std::to_string(env));
    const Offset cone = batch.env_cone_offsets[env], room = batch.env_cone_offsets[env + 1] - cone + 1;
    EXPECT_TRUE(body.counts[at(env)] == host.counts[at(env)]);
    EXPECT_EQ(part(body.cone_order, cone, batch.env_cones(env)), part(host.cone_order, cone, batch.env_cones(env)));
    EXPECT_EQ(
        part(body.vertex_offsets, cone + env, room),
        in_room(host.vertex_offsets, host.env_vertex_offsets[at(env)], host.env_vertex_offsets[at(env) + 1], room));
    EXPECT_EQ(part(body.color_offsets, cone + env, room),
              in_room(host.color_offsets, host.env_color_offsets[at(env)], host.env_color_offsets[at(env) + 1], room));
    sparse += host.path[at(env)] == EnvPath::sparse ? 1 : 0;
  }
}

bool all_sound(const ContactBatchView<double>& batch, Index lanes = 1) {
  bool sound = true;
  for (Offset env = 0; env < batch.env_count; ++env)
    on_lanes(lanes, [&](auto& team) {
      const bool answer = structure_is_sound(team, batch, env);
      single(team, [&] { sound = sound && answer; });
    });
  return sound;
}

bool is_sound_for_the_host(const ContactBatchView<double>& batch) {
  return validate_structure(batch, 1).empty();
}

TEST(PlanBody, OneLanePlansAsTheHostDoes) {
  std::mt19937 random(21);
  int sparse = 0;
  for (int round = 0; round < 1000 && !testing::Test::HasFailure(); ++round) {
    SCOPED_TRACE("batch " + std::to_string(round));
    expect_plan(random_structures(random).view(), 1, sparse);
  }
  EXPECT_GT(sparse, 500) << "the test must reach the sparse path";
}

TEST(PlanBody, ManyLanesPlanAsTheHostDoes) {
  std::mt19937 random(22);
  int sparse = 0;
  for (int round = 0; round < 40 && !testing::Test::HasFailure(); ++round) {
    const ContactBatch<double> batch = random_structures(random);
    for (const Index lanes : {2, 3, 8}) {
      SCOPED_TRACE("batch " + std::to_string(round) + ", lanes " + std::to_string(lanes));
      expect_plan(batch.view(), lanes, sparse);
    }
  }
  EXPECT_GT(sparse, 60) << "the test must reach the sparse path";
}

TEST(PlanBody, RoomBetweenEntriesRowsAndEnvironmentsChangesNothing) {
  std::mt19937 random(23);
  int sparse = 0;
  for (int round = 0; round < 300 && !testing::Test::HasFailure(); ++round) {
    SCOPED_TRACE("batch " + std::to_string(round));
    const ContactBatch<double> batch = random_structures(random);
    const Integers wide = with_room(batch.view(), random);
    ASSERT_TRUE(is_sound_for_the_host(wide.view()));
    ASSERT_TRUE(all_sound(wide.view()));
    expect_plan(wide.view(), round % 30 == 0 ? 3 : 1, sparse);
  }
  EXPECT_GT(sparse, 100);
}

/// n unilateral cones, each joined with the next; `reverse` numbers them from the other end.
Environment<double> chain_of(int n, bool one_sided) {
  Environment<double> env;
  for (int c = 0; c < n; ++c) {
    env.cones.push_back({ConeKind::unilateral, 1, -1});
    if (c > 0) env.column.push_back(c - 1);
    env.column.push_back(c);
    if (c + 1 < n && !one_sided) env.column.push_back(c + 1);
    env.row_offsets.push_back(static_cast<Index>(env.column.size()));
  }
  env.b.resize(at(n));
  env.A.resize(env.column.size());
  return env;
}

// Every inner cone waits for the one before it: more rounds than there may be, so that one lane has to finish.
TEST(PlanBody, LongChainsOfWaitingVerticesAreFinished) {
  int sparse = 0;
  for (const bool one_sided : {false, true}) {
    ContactBatch<double> batch;
    batch.add(chain_of(3 * kColorRounds, one_sided));
    for (const Index lanes : {1, 2, 3, 8}) expect_plan(batch.view(), lanes, sparse);
  }
  EXPECT_EQ(sparse, 8);
}

// One vertex with a neighbour in every other, stored on one side only, and everything in it out of order.
TEST(PlanBody, AHubWithoutMirrorsIsFoundFromTheOtherSide) {
  constexpr int kCones = 2000;
  Environment<double> env = chain_of(kCones, false);
  std::vector<Index> hub(kCones);
  std::iota(hub.begin(), hub.end(), 0);
  std::shuffle(hub.begin(), hub.end(), std::mt19937(4));
  env.column.erase(env.column.begin(), env.column.begin() + 2);
  env.column.insert(env.column.begin(), hub.begin(), hub.end());
  for (std::size_t row = 1; row < env.row_offsets.size(); ++row) env.row_offsets[row] += kCones - 2;
  env.A.resize(env.column.size());
  ContactBatch<double> batch;
  batch.add(env);
  int sparse = 0;
  for (const Index lanes : {1, 8}) expect_plan(batch.view(), lanes, sparse);
  EXPECT_EQ(sparse, 2);
}

TEST(PlanBody, ABatchIsSoundWhereTheHostFindsNoStructuralDefect) {
  std::mt19937 random(24);
  const auto nonsense = [&](Offset value, Offset largest) -> Offset {
    switch (below(random, 6)) {
      case 0:
        return -1 - below(random, 3);
      case 1:
        return largest + below(random, 3);
      case 2:
        return largest > 0 ? static_cast<Offset>(random()) % largest : 0;
      default:
        return value + below(random, 5) - 2;
    }
  };
  const auto damage = [&](auto& array, Offset largest) {
    if (array.empty()) return;
    using T = std::decay_t<decltype(array[0])>;
    T& entry = array[random() % array.size()];
    const bool wild = below(random, 8) == 0;
    const T extreme = below(random, 2) == 0 ? std::numeric_limits<T>::max() : std::numeric_limits<T>::min();
    entry = wild ? extreme : static_cast<T>(nonsense(entry, largest));
  };
  int sound = 0, unsound = 0, unused = 0;
  for (int round = 0; round < 4000 && !testing::Test::HasFailure(); ++round) {
    SCOPED_TRACE("batch " + std::to_string(round));
    const ContactBatch<double> batch = random_structures(random);
    Integers integers = round % 2 == 0 ? Integers(batch) : with_room(batch.view(), random);
    const Offset rows = integers.env_row_offsets.back(), cones = integers.env_cone_offsets.back();
    for (int count = 1 + below(random, 2); count > 0; --count) {
      switch (below(random, 10)) {
        case 0:
          damage(integers.env_row_offsets, rows);
          break;
        case 1:
          damage(integers.env_cone_offsets, cones);
          break;
        case 2:
          damage(integers.cone_row_offsets, rows);
          break;
        case 3:
          damage(integers.row_offsets, integers.nonzeros);
          break;
        case 4:
          damage(integers.column_offsets, static_cast<Offset>(integers.column.size()));
          break;
        case 5:
          damage(integers.env_row_counts, 9);
          break;
        case 6:
          damage(integers.env_cone_counts, 9);
          break;
        case 7:
          damage(integers.row_counts, 5);
          break;
        case 8:
          damage(integers.column, 9);
          break;
        default:
          if (!integers.cone_kind.empty())
            integers.cone_kind[random() % integers.cone_kind.size()] = static_cast<ConeKind>(below(random, 6));
      }
    }
    const bool expected = is_sound_for_the_host(integers.view());
    EXPECT_EQ(all_sound(integers.view(), round % 100 == 0 ? 3 : 1), expected);
    ++(expected ? sound : unsound);
    if (expected && below(random, 4) == 0) expect_plan(integers.view(), 1, unused);
  }
  EXPECT_GT(sound, 500);
  EXPECT_GT(unsound, 1500);
}

// Damage that no neighbour can see is found in the one environment that has it.
TEST(PlanBody, DamageIsFoundInTheEnvironmentThatHasIt) {
  std::mt19937 random(25);
  int found = 0;
  for (int round = 0; round < 500; ++round) {
    Integers integers(random_structures(random));
    if (integers.cone_kind.empty() || integers.column.empty()) continue;
    for (int count = below(random, 4); count > 0; --count) {
      const auto value = below(random, 5);
      if (below(random, 2) == 0) {
        integers.cone_kind[random() % integers.cone_kind.size()] = static_cast<ConeKind>(value);
      } else {
        integers.column[random() % integers.column.size()] = value == 0 ? -1 : 100 * value;
      }
    }
    const ContactBatchView<double> batch = integers.view();
    std::set<Offset> expected, actual;
    for (const Defect& defect : validate_structure(batch, 1000000)) expected.insert(defect.env);
    SerialTeam team;
    for (Offset env = 0; env < batch.env_count; ++env)
      if (!structure_is_sound(team, batch, env)) actual.insert(env);
    EXPECT_EQ(actual, expected) << "batch " << round;
    found += static_cast<int>(expected.size());
  }
  EXPECT_GT(found, 200);
}

TEST(Scan, SumsWhatIsBeforeEachValue) {
  std::mt19937 random(26);
  for (const Index count : {0, 1, 2, 3, 64, 255, 256, 257, 1000}) {
    for (const Index lanes : {1, 2, 3, 8}) {
      SCOPED_TRACE("count " + std::to_string(count) + ", lanes " + std::to_string(lanes));
      std::vector<Index> values(at(count)), parts(kScanParts);
      for (Index& value : values) value = below(random, 20);
      std::vector<Index> expected(values);
      std::exclusive_scan(expected.begin(), expected.end(), expected.begin(), 0);
      const Index sum = std::accumulate(values.begin(), values.end(), 0);
      on_lanes(lanes, [&](auto& team) {
        const Index total = exclusive_scan(team, values.data(), count, parts.data());
        single(team, [&] { EXPECT_EQ(total, sum); });
      });
      EXPECT_EQ(values, expected);
    }
  }
}

}  // namespace
