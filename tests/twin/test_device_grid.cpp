#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "core/team/phases.hpp"
#include "cuda/emulated/emulated_launch.hpp"
#include "cuda/machine/body_machine.hpp"
#include "scenes/body_scenes.hpp"
#include "tests/support/machines/body_methods.hpp"
#include "tests/support/machines/every_solver.hpp"
#include "tests/support/machines/on_engine.hpp"
#include "tests/support/sanitizers.hpp"

/// One team that is the whole device. It is several blocks on the emulated device, whose lanes run at once, disagree
/// about speed and meet at the grid's barrier alone.
namespace stiction::test {
namespace {

constexpr int kLanes = 2;
constexpr int kBlocks = 3;
constexpr int kWidth = kLanes * kBlocks;

/// Values that every lane of a grid saw.
struct Seen {
  Index size[kWidth] = {};
  Index total[kWidth] = {};
  std::uint32_t combined[kWidth] = {};
  double largest[kWidth] = {};
  double sum[kWidth] = {};
  Offset work_counter[kWidth] = {};
  Index neighbours[kWidth] = {};
  bool is_grid[kWidth] = {};
};

/// Everything a team offers, many times over; each lane reads all others' writes before the barrier.
struct LookAround {
  struct Args {
    Seen* seen;
    Index* written;
    Offset* counter;
  };
  static constexpr bool kSerial = false;
  static constexpr int kRounds = 40;

  template <class Team>
  static void run(Team& team, const cuda::TeamId& id, const Args& args) {
    const Index rank = team.rank();
    Seen& seen = *args.seen;
    seen.size[rank] = team.size();
    seen.is_grid[rank] = id.index == 0 && id.count == 1 && id.shared == nullptr;
    for (int round = 1; round <= kRounds; ++round) {
      args.written[rank] = round * (rank + 1);
      team.sync();
      for (Index other = 0; other < team.size(); ++other) seen.neighbours[rank] += args.written[other];
      team.sync();
      seen.total[rank] += team.total(rank + round);
      seen.combined[rank] |= team.combine(1U << rank);
      seen.largest[rank] += team.max(static_cast<double>((rank + round) % kWidth));
      seen.sum[rank] += sum_leaves<double>(team, [&](Index leaf) { return static_cast<double>(leaf + round); });
      seen.work_counter[rank] = team.fetch(args.counter);
    }
  }
};

/// The sums by one lane.
Seen alone() {
  Seen seen;
  Index written[kWidth] = {};
  for (int round = 1; round <= LookAround::kRounds; ++round)
    for (Index rank = 0; rank < kWidth; ++rank) {
      written[rank] = round * (rank + 1);
      seen.neighbours[0] += written[rank];
      seen.total[0] += rank + round;
      seen.combined[0] |= 1U << rank;
    }
  for (int round = 1; round <= LookAround::kRounds; ++round) {
    SerialTeam team;
    seen.largest[0] += kWidth - 1;
    seen.sum[0] += sum_leaves<double>(team, [&](Index leaf) { return static_cast<double>(leaf + round); });
    seen.work_counter[0] = round - 1;
  }
  return seen;
}

/// Records of the values seen by lanes of a launch for the whole device, and of their fetches.
struct Look {
  Seen seen;
  Offset fetched = 0;
};
Look look_around(cuda::EmulatedDevice& device, Offset teams) {
  const cuda::Stream stream(device);
  Look look;
  Index written[kWidth] = {};
  const LookAround::Args args{&look.seen, written, &look.fetched};
  cuda::LaunchShape shape;
  shape.teams = teams;
  shape.lanes = cuda::kMostLanes;
  shape.whole_device = true;
  device.launch(cuda::emulated_kernel<LookAround>("look_around"), shape, &args, stream.get());
  device.synchronize(stream.get());
  return look;
}

TEST(DeviceGrid, LanesOfAllBlocksRunAtOnceAndMeetAtOneBarrier) {
  const Seen expected = alone();
  for (std::uint64_t seed = 0; seed < 12; ++seed) {
    cuda::EmulatedDevice device({kLanes, kBlocks, seed});
    const auto [seen, fetched] = look_around(device, 1);
    for (Index rank = 0; rank < kWidth; ++rank) {
      SCOPED_TRACE("lane " + std::to_string(rank) + ", seed " + std::to_string(seed));
      EXPECT_EQ(seen.size[rank], kWidth);
      EXPECT_TRUE(seen.is_grid[rank]);
      EXPECT_EQ(seen.neighbours[rank], expected.neighbours[0]);
      EXPECT_EQ(seen.total[rank], expected.total[0]);
      EXPECT_EQ(seen.combined[rank], expected.combined[0]);
      EXPECT_EQ(seen.largest[rank], expected.largest[0]);
      EXPECT_EQ(seen.sum[rank], expected.sum[0]);
      EXPECT_EQ(seen.work_counter[rank], expected.work_counter[0]);
    }
    EXPECT_EQ(fetched, LookAround::kRounds);
  }
}

SolverOptions brief(SolverKind solver, Law law) {
  SolverOptions options;
  options.solver = solver;
  options.law = law;
  // Without a matrix an iteration of these is a whole inner iteration.
  options.max_iterations = is_costly(solver) || kSanitizer ? 1 : 4;
  options.invalid = InvalidPolicy::isolate;
  options.threads = 1;
  return options;
}

/// One environment for the whole device, and small ones beside it.
ContactBatch<double> giant_among_small(SolverKind solver) {
  ContactBatch<double> batch(Law::coulomb);
  batch.add(scenes::make("stack", 9, 0, 2).system);
  batch.add(scenes::make("pile", 5, 0, 2100).system);
  batch.add(scenes::make("stack", 9, 1, 1).system);
  return solver == SolverKind::lemke ? linearise(batch, 4).batch : batch;
}

template <class Real>
void expect_the_cpus_bits_of_a_giant(SolverKind solver, Law law) {
  const ContactBatch<Real> batch = convert<Real>(giant_among_small(solver));
  ASSERT_GE(batch.view().env_rows(1), kWholeDeviceRows);
  cuda::EmulatedDevice device({kLanes, kBlocks, 5});
  EXPECT_EQ(on_engine(device, batch, brief(solver, law)), solve_hashes(batch, brief(solver, law)));
}

class Giants : public testing::TestWithParam<SolverKind> {};

// The work of a lane does not depend on how law and precision are paired; test_device_engine.cpp has every pair.
TEST_P(Giants, HaveTheCpusBitsInSinglePrecision) {
  if (kSanitizer && !kThreadSanitizer) GTEST_SKIP() << "the address sanitizer sees the larger memory of the double one";
  expect_the_cpus_bits_of_a_giant<float>(GetParam(), Law::convex);
}

TEST_P(Giants, HaveTheCpusBitsInDoublePrecision) {
  if (kThreadSanitizer) GTEST_SKIP() << "the thread sanitizer sees the same accesses in single precision";
  expect_the_cpus_bits_of_a_giant<double>(GetParam(), Law::coulomb);
}

// Blocks of a grid that never run would be waited for: one block takes the environment.
TEST(DeviceGrid, AGiantHasOneBlockWhereOthersHoldAPartOfTheDevice) {
  cuda::EmulatedDeviceOptions options{kLanes, kBlocks, 5};
  options.is_whole = false;
  cuda::EmulatedDevice device(options);
  const Look look = look_around(device, 7);
  EXPECT_EQ(look.seen.size[0], kLanes);
  EXPECT_EQ(look.fetched, LookAround::kRounds) << "one team";
  const ContactBatch<float> batch = convert<float>(giant_among_small(SolverKind::npgs));
  const SolverOptions chosen = brief(SolverKind::npgs, Law::convex);
  EXPECT_EQ(on_engine(device, batch, chosen), solve_hashes(batch, chosen));
}

INSTANTIATE_TEST_SUITE_P(DeviceGrid, Giants, testing::ValuesIn(kEveryChoice),
                         [](const auto& solver) { return std::string(to_string(solver.param)); });

template <class Real>
void expect_the_cpus_bits_of_a_pile(BodySolverOptions options) {
  options.threads = 1;
  BodyBatch<Real> batch;
  batch.add(as<Real>(scenes::make_body_pile(5, 16400)));
  batch.add(as<Real>(random_bodies(3, 5, 20)));
  ASSERT_GT(batch.view().env_contact_offsets[1], 16385);
  const BodyPlan plan = BodySolver(Device::cpu(), {}, options).plan(batch.view());
  BodySolution<Real> out{std::vector<Real>(static_cast<std::size_t>(3 * batch.contact_count())),
                         std::vector<Real>(static_cast<std::size_t>(6 * batch.body_count())),
                         std::vector<Real>(static_cast<std::size_t>(3 * batch.contact_count())),
                         std::vector<EnvStatus>(2)};
  cuda::DeviceBodyMachine machine(
      std::make_shared<cuda::EmulatedDevice>(cuda::EmulatedDeviceOptions{kLanes, kBlocks, 5}), true);
  machine.solve({plan.shared(),
                 batch.view(),
                 {out.impulse.data(), out.twist.data(), out.w.data(), out.status.data()},
                 nullptr,
                 TimeStepping{},
                 options,
                 StreamRef::default_stream()});
  expect_same_bodies(solve_bodies(batch, {}, options), out, "");
}

TEST(DeviceGrid, ImpulsesOfOneLargeSceneHaveTheCpusBits) {
  for (const bool momentum : {false, true}) {
    SCOPED_TRACE(momentum ? "momentum" : "no momentum");
    BodySolverOptions options;
    options.iterations = 2;
    options.momentum = momentum;
    options.substeps = momentum ? 2 : 1;
    options.law = momentum ? Law::coulomb : Law::convex;
    expect_the_cpus_bits_of_a_pile<float>(options);
    if (kThreadSanitizer) continue;  // the same accesses
    options.law = momentum ? Law::convex : Law::coulomb;
    expect_the_cpus_bits_of_a_pile<double>(options);
  }
}

TEST(DeviceGrid, NewtonsMethodOnOneLargeSceneHasTheCpusBits) {
  BodySolverOptions options = newton_options(Law::coulomb, BodyPreconditioner::block_diagonal);
  options.iterations = 1;
  expect_the_cpus_bits_of_a_pile<float>(options);
}

}  // namespace
}  // namespace stiction::test
