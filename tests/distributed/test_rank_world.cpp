// A world that no rank holds as a whole has the bits of one process.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <map>
#include <mutex>
#include <random>
#include <span>

#include "distributed/transport/thread_transport.hpp"
#include "distributed/world/rank_world.hpp"
#include "scenes/worlds.hpp"
#include "tests/support/bits.hpp"

namespace stiction::distributed {
namespace {

constexpr double kDeadline = 100;
using Seed = std::optional<std::uint64_t>;

/// A world's bodies, its last contacts and how they ended.
template <class Real>
struct Snapshot {
  std::vector<Real> position, orientation, twist;
  std::map<std::uint64_t, std::array<Real, 3>> impulse;
  EnvStatus status{};
};

template <class Real>
void expect_same(const Snapshot<Real>& a, const Snapshot<Real>& b) {
  using Numbers = std::span<const Real>;
  EXPECT_TRUE(test::same_bits(Numbers(a.position), Numbers(b.position)));
  EXPECT_TRUE(test::same_bits(Numbers(a.orientation), Numbers(b.orientation)));
  EXPECT_TRUE(test::same_bits(Numbers(a.twist), Numbers(b.twist)));
  EXPECT_EQ(a.impulse, b.impulse);
  EXPECT_TRUE(test::same_bits(std::span<const EnvStatus>(&a.status, 1), std::span<const EnvStatus>(&b.status, 1)));
}

template <class Real>
std::map<std::uint64_t, std::array<Real, 3>> by_id(std::span<const std::uint64_t> id, std::span<const Real> impulse) {
  std::map<std::uint64_t, std::array<Real, 3>> all;
  for (std::size_t k = 0; k < id.size(); ++k) all[id[k]] = {impulse[3 * k], impulse[3 * k + 1], impulse[3 * k + 2]};
  return all;
}

/// A scene that has begun, and how it is stepped.
struct Case {
  WorldDescription description;
  WorldOptions options;
  std::vector<std::array<double, 6>> wrench;  ///< empty: none
  int steps = 20;
};

template <class Real>
World<Real> world_of(const Case& scene) {
  World<Real> world(Device::cpu(), scene.description, 1, scene.options);
  for (std::size_t k = 0; k < scene.wrench.size(); ++k)
    for (std::size_t j = 0; j < 6; ++j) world.wrench()[6 * k + j] = static_cast<Real>(scene.wrench[k][j]);
  return world;
}

template <class Real>
Snapshot<Real> by_one_process(const Case& scene) {
  World<Real> world = world_of<Real>(scene);
  for (int step = 0; step < scene.steps; ++step) world.step();
  const WorldCheckpoint<Real> end = world.checkpoint();
  return {end.position, end.orientation, end.twist, by_id<Real>(end.contact_id, end.impulse), world.status()[0]};
}

/// Returns this rank's part of a checkpoint.
template <class Real>
void put(RankWorld<Real>& world, const WorldCheckpoint<Real>& from) {
  const BodyRange share = world.first_share();
  BodyList<Real> bodies;
  for (Index body = share.first; body < share.end; ++body) {
    BodyNumbers<Real> numbers;
    for_each_number(
        [&](std::size_t width, auto& to, const auto& all) {
          std::copy_n(all.begin() + static_cast<std::ptrdiff_t>(width) * body, width, to);
        },
        numbers, from);
    bodies.add(body, numbers);
  }
  Impulses<Real> last;
  for (std::size_t c = 0; c < from.contact_id.size(); ++c) {
    const ShapePair pair = world.pair_of(from.contact_id[c]);
    if (!share.has(pair.body_a) && !share.has(pair.body_b)) continue;
    last.id.push_back(from.contact_id[c]);
    for (std::size_t j = 0; j < 3; ++j) last.impulse.push_back(from.impulse[3 * c + j]);
  }
  world.put(std::move(bodies), std::move(last));
}

struct Counts {
  std::int64_t migrated = 0, waves = 0;
  Offset owned = 0, near = 0;  ///< of all ranks
  Offset most = 0;             ///< that one rank owns
};

template <class Real>
Snapshot<Real> by_ranks(const Case& scene, int ranks, Seed random, const WorldCheckpoint<Real>& from, int steps,
                        Counts* counts = nullptr) {
  const WorldModel<Real> whole(scene.description, scene.options);
  const std::size_t bodies = scene.description.bodies.size();
  Snapshot<Real> all;
  const auto unset = static_cast<Real>(777);
  all.position.assign(3 * bodies, unset);
  all.orientation.assign(4 * bodies, unset);
  all.twist.assign(6 * bodies, unset);
  std::vector<EnvStatus> statuses;
  std::mutex mutex;
  run_thread_ranks(ranks, kDeadline, [&](Transport& transport) {
    RankWorld<Real> world(transport, whole.view(), scene.options, random);
    put(world, from);
    for (int step = 0; step < steps; ++step) world.step();
    const std::lock_guard lock(mutex);
    for (std::size_t k = 0; k < world.bodies().size(); ++k) {
      const auto body = static_cast<std::ptrdiff_t>(world.bodies().body[k]);
      const BodyNumbers<Real>& numbers = world.bodies().numbers[k];
      EXPECT_EQ(all.position[3 * static_cast<std::size_t>(body)], unset) << "body " << body << " has two owners";
      std::copy_n(numbers.position, 3, all.position.begin() + 3 * body);
      std::copy_n(numbers.orientation, 4, all.orientation.begin() + 4 * body);
      std::copy_n(numbers.twist, 6, all.twist.begin() + 6 * body);
    }
    const Impulses<Real>& impulses = world.impulses();
    for (const auto& [id, impulse] : by_id<Real>(impulses.id, impulses.impulse)) {
      const auto [place, is_new] = all.impulse.emplace(id, impulse);
      EXPECT_TRUE(is_new || place->second == impulse) << "two ranks differ about contact " << id;
    }
    statuses.push_back(world.status());
    if (counts == nullptr) return;
    counts->migrated += world.step_traffic().migrated;
    counts->waves += world.step_traffic().waves;
    counts->owned += static_cast<Offset>(world.bodies().size());
    counts->most = std::max(counts->most, static_cast<Offset>(world.bodies().size()));
    counts->near += world.step_traffic().near_bodies;
  });
  all.status = statuses.front();
  EXPECT_TRUE(test::same_bits(std::span<const EnvStatus>(statuses),
                              std::span<const EnvStatus>(std::vector<EnvStatus>(statuses.size(), all.status))));
  return all;
}

template <class Real>
void expect_one_world(const Case& scene) {
  const Snapshot<Real> one = by_one_process<Real>(scene);
  const WorldCheckpoint<Real> begin = world_of<Real>(scene).checkpoint();
  for (int ranks = 1; ranks <= 4; ++ranks) {
    SCOPED_TRACE(std::to_string(ranks) + " ranks");
    expect_same(by_ranks<Real>(scene, ranks, {}, begin, scene.steps), one);
    if (ranks > 1) expect_same(by_ranks<Real>(scene, ranks, 7, begin, scene.steps), one);
  }
}

void add(Case& scene, const WorldShape& shape, const std::array<double, 3>& position,
         const std::array<double, 6>& twist = {}) {
  WorldShape own = shape;
  own.body = static_cast<Index>(scene.description.bodies.size());
  WorldBody body = solid_body(own, 1000);
  body.position = position;
  body.twist = twist;
  scene.description.bodies.push_back(body);
  scene.description.shapes.push_back(own);
}

Case on_a_floor() {
  Case scene;
  scene.options.solver.iterations = 20;
  scene.options.solver.tolerance = 0;
  scene.description.shapes.push_back({.kind = ShapeKind::plane});
  return scene;
}

/// Bricks in courses: all within have as many contacts, so the order of their numbers decides the colours.
Case wall(int courses, int bricks) {
  Case scene = on_a_floor();
  const WorldShape brick{.kind = ShapeKind::box, .size = {0.2, 0.1, 0.1}, .mu = 0.6};
  for (int course = 0; course < courses; ++course)
    for (int k = 0; k < bricks; ++k)
      add(scene, brick, {0.4 * k + (course % 2 == 0 ? 0 : 0.2), 0, 0.1 + 0.2 * course},
          {0, 0, 0, 0, 0, course == 2 ? 0.3 : 0});
  return scene;
}

/// Spheres, capsules and boxes in the air.
Case heap(int count, std::uint64_t seed) {
  Case scene = on_a_floor();
  std::mt19937_64 random(seed);
  const auto symmetric = [&] { return static_cast<double>(random() >> 11U) * 0x1p-52 - 1; };
  for (int k = 0; k < count; ++k) {
    const auto kind = static_cast<ShapeKind>(k % 3);
    const WorldShape shape{.kind = kind,
                           .size = kind == ShapeKind::box ? std::array{0.08, 0.06, 0.1} : std::array{0.08, 0.07, 0.0},
                           .mu = 0.4,
                           .restitution = 0.2};
    add(scene, shape, {0.22 * (k % 4), 0.22 * Index{k / 4 % 4}, 0.12 + 0.22 * Index{k / 16}},
        {symmetric(), symmetric(), symmetric() - 1, 3 * symmetric(), 3 * symmetric(), 3 * symmetric()});
  }
  return scene;
}

TEST(RankWorld, AWall) {
  expect_one_world<double>(wall(5, 6));
  expect_one_world<float>(wall(4, 5));
}

TEST(RankWorld, AHeapUnderAllLaws) {
  Case scene = heap(48, 1);
  scene.steps = 40;
  expect_one_world<double>(scene);
  scene.options.solver.law = Law::convex;
  expect_one_world<float>(scene);
  scene.options.solver.law = Law::coulomb;
  scene.options.solver.box_friction = true;
  scene.steps = 20;
  expect_one_world<double>(scene);
  expect_one_world<float>(scene);
}

TEST(RankWorld, APileThatStopsByTolerance) {
  Case scene;
  const scenes::WorldScene pile = scenes::make_world("pile", 150);
  scene.description = pile.description;
  const scenes::WorldStart start = scenes::start_world("pile", 3, 0, 150);
  for (std::size_t k = 0; k < scene.description.bodies.size(); ++k) {
    std::copy_n(start.position.begin() + static_cast<std::ptrdiff_t>(3 * k), 3,
                scene.description.bodies[k].position.begin());
    std::copy_n(start.orientation.begin() + static_cast<std::ptrdiff_t>(4 * k), 4,
                scene.description.bodies[k].orientation.begin());
    std::copy_n(start.twist.begin() + static_cast<std::ptrdiff_t>(6 * k), 6, scene.description.bodies[k].twist.begin());
  }
  scene.options.stepping = pile.stepping;
  scene.options.solver.tolerance = 1e-4;
  scene.options.warm_start = 0;
  expect_one_world<double>(scene);
}

TEST(RankWorld, ABodyWithMoreContactsThanAWordHasBits) {
  Case scene = on_a_floor();
  add(scene, {.kind = ShapeKind::box, .size = {1.2, 1.2, 0.1}}, {0, 0, 0.1});
  for (int k = 0; k < 81; ++k)
    add(scene, {.kind = ShapeKind::sphere, .size = {0.1, 0, 0}},
        {0.24 * (k % 9) - 0.96, 0.24 * Index{k / 9} - 0.96, 0.3});
  scene.steps = 5;
  expect_one_world<double>(scene);
}

TEST(RankWorld, BodiesThatGoToOtherRanksTakeTheirImpulsesAlong) {
  // Two flights of three stacked boxes each slide through one another's half.
  Case scene = on_a_floor();
  const WorldShape box{.kind = ShapeKind::box, .size = {0.1, 0.1, 0.1}, .mu = 0.05};
  for (int k = 0; k < 12; ++k) {
    const bool is_left = k % 2 == 0;
    add(scene, box,
        {is_left ? -0.6 - 0.3 * Index{k / 6} : 0.6 + 0.3 * Index{k / 6}, is_left ? 0 : 0.4,
         0.1 + 0.2 * Index{k / 2 % 3}},
        {is_left ? 5.0 : -5.0, 0, 0, 0, 0, 0});
  }
  scene.steps = 50;
  expect_one_world<double>(scene);
  const Snapshot<double> one = by_one_process<double>(scene);
  for (const int ranks : {2, 3}) {
    Counts counts;
    expect_same(by_ranks<double>(scene, ranks, {}, world_of<double>(scene).checkpoint(), scene.steps, &counts), one);
    EXPECT_GT(counts.migrated, 4);
    EXPECT_EQ(counts.owned, 12);
  }
}

TEST(RankWorld, ForcesAndABodyWithoutShape) {
  Case scene = heap(12, 2);
  scene.description.bodies.emplace_back();
  for (std::size_t k = 0; k < scene.description.bodies.size(); ++k) {
    const auto x = static_cast<double>(k);
    scene.wrench.push_back({0.1 * x, -0.2 * x, 3, 0.01, 0.02 * x, -0.03});
  }
  expect_one_world<double>(scene);
}

TEST(RankWorld, RestartsWithAnyNumberOfRanks) {
  Case scene = heap(40, 3);
  scene.steps = 60;
  const Snapshot<double> one = by_one_process<double>(scene);
  World<double> half = world_of<double>(scene);
  for (int step = 0; step < 37; ++step) half.step();
  const WorldCheckpoint<double> point = half.checkpoint();
  ASSERT_GT(point.contact_id.size(), 20U);
  for (const int ranks : {1, 2, 3, 4}) expect_same(by_ranks<double>(scene, ranks, {}, point, 23), one);
  expect_same(by_ranks<double>(scene, 3, 5, point, 23), one);
}

/// Steps that begin with a checkpoint, by one process and by ranks.
void expect_one_world_from(const Case& scene, const WorldCheckpoint<double>& point) {
  World<double> world = world_of<double>(scene);
  world.resume(point);
  for (int step = 0; step < scene.steps; ++step) world.step();
  const WorldCheckpoint<double> end = world.checkpoint();
  const Snapshot<double> one{end.position, end.orientation, end.twist, by_id<double>(end.contact_id, end.impulse),
                             world.status()[0]};
  for (const int ranks : {2, 3}) expect_same(by_ranks<double>(scene, ranks, {}, point, scene.steps), one);
}

TEST(RankWorld, ABodyThatIsNowhereStopsAllRanks) {
  Case scene = heap(16, 4);
  scene.steps = 3;
  const WorldCheckpoint<double> sound = world_of<double>(scene).checkpoint();
  for (const double broken :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), 1e25}) {
    SCOPED_TRACE(broken);
    WorldCheckpoint<double> point = sound;
    point.position[3 * 5] = broken;
    expect_one_world_from(scene, point);
  }
}

TEST(RankWorld, ABodyThatMayBeAnywhereIsEverybodysGhost) {
  Case scene = heap(16, 4);
  scene.steps = 1;
  WorldCheckpoint<double> point = world_of<double>(scene).checkpoint();
  point.twist[6 * 5] = 1e22;  // so far in a step that squares of distances may overflow
  expect_one_world_from(scene, point);
}

TEST(RankWorld, MoreRanksThanBodiesAndNoBodies) {
  Case scene = on_a_floor();
  const WorldShape ball{.kind = ShapeKind::sphere, .size = {0.1, 0, 0}};
  for (int k = 0; k < 3; ++k) add(scene, ball, {0, 0, 0.1 + 0.19 * k});
  expect_same(by_ranks<double>(scene, 6, {}, world_of<double>(scene).checkpoint(), scene.steps),
              by_one_process<double>(scene));
  Case empty = on_a_floor();
  expect_same(by_ranks<double>(empty, 2, {}, world_of<double>(empty).checkpoint(), 2), by_one_process<double>(empty));
}

TEST(RankWorld, ARankHoldsItsOwnBodiesAndThoseAtItsBorder) {
  Case scene = wall(4, 40);
  scene.steps = 2;
  Counts counts;
  by_ranks<double>(scene, 4, {}, world_of<double>(scene).checkpoint(), scene.steps, &counts);
  EXPECT_EQ(counts.owned, 160);
  EXPECT_GT(counts.near, 160);
  // Three borders, and at most three bricks of each course to either side of one: boxes reach 0.2 + a brick's diagonal.
  EXPECT_LE(counts.near, 160 + 3 * 2 * 3 * 4);
}

TEST(RankWorld, SharesBodiesOutAnewWhenTheyGather) {
  // All go to the left; those that began on the right have crossed every cut.
  Case scene = on_a_floor();
  for (int k = 0; k < 24; ++k)
    add(scene, {.kind = ShapeKind::sphere, .size = {0.1, 0, 0}}, {0.3 * k, 0.25 * k, 1},
        {k < 12 ? 0.0 : -0.3 * (k - 11.5) / 0.14, 0, 4, 0, 0, 0});
  scene.options.stepping.dt = 0.01;
  scene.steps = 16;
  const Snapshot<double> one = by_one_process<double>(scene);
  int left = 0;
  for (std::size_t k = 0; k < 24; ++k) left += one.position[3 * k] < 0.3 * 11.5 ? 1 : 0;
  ASSERT_EQ(left, 24);
  Counts counts;
  scene.steps = 18;  // one more, after cells were cut at the sixteenth
  by_ranks<double>(scene, 2, {}, world_of<double>(scene).checkpoint(), scene.steps, &counts);
  EXPECT_EQ(counts.owned, 24);
  EXPECT_LE(counts.most, 14);
}

TEST(RankWorld, RefusesImpulsesOfNoPair) {
  const Case scene = heap(4, 5);
  std::uint64_t pairs = 0;
  for (const WorldShape& a : scene.description.shapes)
    for (const WorldShape& b : scene.description.shapes) pairs += a.body < b.body ? 1 : 0;
  run_thread_ranks(1, kDeadline, [&](Transport& transport) {
    const WorldModel<double> whole(scene.description, scene.options);
    RankWorld<double> world(transport, whole.view(), scene.options);
    const std::uint64_t last = pairs * kFeatures - 1;
    EXPECT_LT(world.pair_of(last).body_a, world.pair_of(last).body_b);
    EXPECT_NO_THROW(world.put({}, {{last}, {1, 2, 3}}));
    for (const std::uint64_t id : {last + 1, ~std::uint64_t{0}}) EXPECT_THROW(world.put({}, {{id}, {1, 2, 3}}), Error);
  });
}

TEST(RankWorld, RefusesRanksThatDiffer) {
  const Case scene = heap(4, 5);
  Case other = scene;
  other.options.warm_start = 0.5;
  const auto attempt = [&](const Case& of_second) {
    run_thread_ranks(2, kDeadline, [&](Transport& transport) {
      const Case& own = transport.rank() == 0 ? scene : of_second;
      const WorldModel<double> whole(own.description, own.options);
      const RankWorld<double> world(transport, whole.view(), own.options);
    });
  };
  EXPECT_NO_THROW(attempt(scene));
  EXPECT_THROW(attempt(other), Error);
  other = scene;
  other.description.bodies[2].mass *= 2;
  EXPECT_THROW(attempt(other), Error);
}

}  // namespace
}  // namespace stiction::distributed
