#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <memory>
#include <numeric>
#include <vector>

#include "cuda/emulated/emulated_device.hpp"
#include "cuda/machine/jacobian_machine.hpp"
#include "tests/support/machines/device_jacobians.hpp"
#include "tests/support/machines/velocity_packs.hpp"
#include "tests/support/systems/roomy_jacobians.hpp"
#include "tests/support/systems/velocity_cases.hpp"

/// Newton's method in velocities by teams: the bits of one lane, whatever lanes a team has.
namespace stiction::test {
namespace {

/// Arrays that a launch reads, of environments that are sound.
template <class Real>
struct Arrays {
  std::vector<std::uint32_t> flags;
  std::vector<Offset> matrix, factor;
  std::vector<Index> rows, cones;
  JacobianArrays<Real> view{};

  explicit Arrays(std::size_t envs) : flags(envs, 0), matrix(envs, 1), factor(envs, 1), rows(envs, 1), cones(envs, 1) {
    view.flags = flags.data();
    view.matrix = matrix.data();
    view.factor = factor.data();
    view.env_row_counts = rows.data();
    view.env_cone_counts = cones.data();
  }
};

template <class Real>
struct Setting {
  int lanes = 16;
  Offset room = Offset{40} << 10;
  bool in_double = false;
  std::uint64_t seed = 0;
  bool at_any_pace = false;
};

/// Answers of one launch by teams.
template <class Real>
Answers<Real> solve_by_teams(const JacobianBatch<Real>& batch, const Setting<Real>& setting, double tolerance,
                             const JacobianStart<Real>& start = {}) {
  cuda::EmulatedDeviceOptions options;
  options.lanes = setting.lanes;
  options.seed = setting.seed;
  options.at_any_pace = setting.at_any_pace;
  cuda::EmulatedDevice device(options);
  const JacobianBatchView<Real> view = batch.view();
  Answers<Real> answers = no_answers(view);
  std::fill(answers.answered.begin(), answers.answered.end(), std::uint8_t{0});
  Arrays<Real> arrays(static_cast<std::size_t>(view.env_count));
  cuda::VelocityTeamArgs<Real> args{job_of(view, tolerance, start, answers), arrays.view, setting.room};
  args.arrays.answered = args.job.answered;
  const auto& kernels = device.kernels().velocity[sizeof(Real) == sizeof(float) ? 0 : 1];
  const cuda::KernelRef kernel = setting.in_double ? kernels.steps_in_double.teams : kernels.steps.teams;
  const cuda::LaunchShape shape{view.env_count, setting.lanes, static_cast<std::size_t>(setting.room)};
  const cuda::Stream stream(device);
  device.launch(kernel, shape, &args, stream.get());
  device.synchronize(stream.get());
  return answers;
}

template <class Real>
JacobianBatch<Real> chains(Law law, MassForm form) {
  JacobianBatch<Real> batch(law, form);
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const auto dofs = static_cast<Index>(5 + 9 * seed);
    batch.add(cast<Real>(in_form(random_chain({seed, dofs, cones_of_every_kind()}), form)));
  }
  batch.add(cast<Real>(in_form(random_chain({9, 12, {}}), form)));
  // Roots of two and of four rows, which are eliminated together.
  for (const Index dofs : {2, 4}) batch.add(cast<Real>(in_form(random_chain({10, dofs}), form)));
  return batch;
}

std::vector<Offset> upwards(Offset count) {
  std::vector<Offset> order(static_cast<std::size_t>(count));
  std::iota(order.begin(), order.end(), Offset{0});
  return order;
}

/// Only whether there is an answer.
template <class Real>
Answers<Real> without_marks(Answers<Real> answers) {
  for (std::uint8_t& answered : answers.answered) answered &= kAnswered;
  return answers;
}

template <class Real>
void expect_bits_of_one_lane(Law law, MassForm form, double tolerance) {
  const JacobianBatch<Real> batch = chains<Real>(law, form);
  const auto expected = solve_one_by_one(batch, upwards(batch.env_count()), tolerance);
  EXPECT_GE(std::count(expected.answered.begin(), expected.answered.end(), kAnswered), law == Law::convex ? 4 : 2);
  for (const int lanes : {8, 16, 32}) {
    SCOPED_TRACE(lanes);
    expect_the_same(expected,
                    without_marks(solve_by_teams(batch, Setting<Real>{lanes, Offset{lanes} * 5120}, tolerance)));
  }
}

TEST(VelocityTeams, HaveTheBitsOfOneLane) {
  for (const Law law : {Law::convex, Law::coulomb})
    for (const MassForm form : {MassForm::matrix, MassForm::factor}) {
      expect_bits_of_one_lane<double>(law, form, 1e-8);
      expect_bits_of_one_lane<float>(law, form, 1e-4);
    }
}

/// A lane that dawdles behind a barrier shows where another reads a number that it has yet to write.
TEST(VelocityTeams, HaveThemAtAnyPace) {
  JacobianBatch<float> batch(Law::convex);
  for (const Index dofs : {2, 4, 9}) batch.add(cast<float>(random_chain({10, dofs})));
  const auto expected = solve_one_by_one(batch, upwards(batch.env_count()), 1e-4);
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    SCOPED_TRACE(seed);
    expect_the_same(expected,
                    without_marks(solve_by_teams(batch, Setting<float>{8, Offset{40} << 10, false, seed, true}, 1e-4)));
  }
}

TEST(VelocityTeams, HaveThemFromEveryStart) {
  const JacobianBatch<double> batch = chains<double>(Law::convex, MassForm::matrix);
  const auto order = upwards(batch.env_count());
  const auto before = solve_one_by_one(batch, order, 1e-8);
  auto broken = before.lambda;
  broken.front() = std::numeric_limits<double>::quiet_NaN();
  for (const JacobianStart<double>& start : {JacobianStart<double>{before.lambda.data(), nullptr},
                                             {nullptr, before.velocity.data()},
                                             {before.lambda.data(), before.velocity.data()},
                                             {broken.data(), nullptr}})
    expect_the_same(solve_one_by_one(batch, order, 1e-8, start),
                    without_marks(solve_by_teams(batch, Setting<double>{8}, 1e-8, start)));
}

TEST(VelocityTeams, StepInDoubleWhereSinglePrecisionEnds) {
  const JacobianBatch<float> batch = chains<float>(Law::convex, MassForm::matrix);
  const auto expected = solve_one_by_one(batch, upwards(batch.env_count()), 1e-7);
  Setting<float> setting;
  setting.in_double = true;
  const auto found = solve_by_teams(batch, setting, 1e-7);
  // One lane tries environments without an answer once more, in single precision.
  for (std::size_t env = 0; env < found.answered.size(); ++env)
    EXPECT_EQ(found.answered[env], expected.answered[env] == kAnswered ? kAnswered : kTriedInDouble) << env;
}

TEST(VelocityTeams, LeaveWhatDoesNotFitAsItIs) {
  const JacobianBatch<double> batch = chains<double>(Law::convex, MassForm::matrix);
  const auto expected = solve_one_by_one(batch, upwards(batch.env_count()), 1e-8);
  Setting<double> setting;
  setting.room = Offset{16} << 10;
  const auto found = solve_by_teams(batch, setting, 1e-8);
  EXPECT_GT(std::count(found.answered.begin(), found.answered.end(), kAnswered), 0);
  EXPECT_GT(std::count(found.answered.begin(), found.answered.end(), 0), 0);
  for (std::size_t env = 0; env + 1 < found.answered.size(); ++env) {  // the last has no rows
    const auto row = static_cast<std::size_t>(batch.view().env_row_offsets[env]);
    if (found.answered[env] != kTried) {
      EXPECT_EQ(found.lambda[row], found.answered[env] == kAnswered ? expected.lambda[row] : -7.0);
    }
  }
}

TEST(VelocityTeams, TellWhatTheyTriedInVain) {
  const JacobianBatch<double> batch = chains<double>(Law::convex, MassForm::matrix);
  const auto found = solve_by_teams(batch, Setting<double>{}, 1e-300);
  for (const std::uint8_t answered : found.answered) EXPECT_TRUE(answered == kTried || answered == kAnswered);
  EXPECT_GT(std::count(found.answered.begin(), found.answered.end(), kTried), 0);
}

// Many environments have a lane each, and no teams.
TEST(VelocityTeams, AreLeftOutWhereEnvironmentsAreMany) {
  const JacobianBatch<float> batch = chains<float>(Law::convex, MassForm::matrix);
  const auto packed = batch.view();
  const SolverOptions chosen = some_iterations<float>(SolverKind::automatic);
  const auto expected = solve(packed, chosen);
  auto view = packed;
  view.space = MemorySpace::cuda;
  for (const Offset many : {0, 1000}) {
    SCOPED_TRACE(many);
    const auto device = std::make_shared<cuda::EmulatedDevice>();
    Machine<float> machine(device, JacobianCapacity::of(packed), FactorUse::by_size, chosen, cuda::VelocityRules{many});
    Answer<float> answer(view);
    const cuda::Stream stream(*device);
    machine.solve(view, answer.view(), StreamRef(stream.get()));
    device->synchronize(stream.get());
    expect_all(view, answer, packed, expected);
  }
}

}  // namespace
}  // namespace stiction::test
