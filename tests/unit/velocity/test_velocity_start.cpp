#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "stiction/error.hpp"
#include "stiction/jacobian_solver.hpp"
#include "stiction/residual.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/systems/jacobian_answer.hpp"
#include "tests/support/systems/roomy_jacobians.hpp"
#include "tests/support/systems/velocity_cases.hpp"

/// Velocities as the place that Newton's method in velocities starts from.
namespace {

using namespace stiction;
using namespace stiction::test;

struct Answer : JacobianAnswer<double> {
  using JacobianAnswer::JacobianAnswer;

  [[nodiscard]] Index iterations() const {
    Index sum = 0;
    for (const EnvStatus& one : status) sum += one.iterations;
    return sum;
  }
};

JacobianBatch<double> chains(Law law = Law::convex, double compliance = 0.01) {
  JacobianBatch<double> batch(law);
  for (std::uint64_t seed = 1; seed <= 40; ++seed)
    batch.add(random_chain({seed, static_cast<Index>(4 + seed % 12), cones_of_every_kind(), 0.0, compliance}));
  return batch;
}

Answer solve_from(const JacobianBatch<double>& batch, const JacobianStart<double>& start, double tolerance = 1e-8,
                  Index iterations = 1000) {
  JacobianSolver<double> solver(Device::cpu(), options(SolverKind::automatic, tolerance, iterations), {});
  Answer answer(batch.view());
  solver.solve(batch.view(), answer.view(), start);
  return answer;
}

void expect_equal(const Answer& expected, const Answer& actual) {
  EXPECT_TRUE(same_bits(std::span<const double>(expected.lambda), std::span<const double>(actual.lambda)));
  EXPECT_TRUE(same_bits(std::span<const double>(expected.w), std::span<const double>(actual.w)));
  EXPECT_TRUE(same_bits(std::span<const double>(expected.velocity), std::span<const double>(actual.velocity)));
  EXPECT_TRUE(same_bits(std::span<const EnvStatus>(expected.status), std::span<const EnvStatus>(actual.status)));
}

TEST(VelocityStart, AtTheSolutionTakesAlmostNoStep) {
  const auto batch = chains();
  const Answer cold = solve_from(batch, {}, 1e-9);
  const Answer warm = solve_from(batch, {nullptr, cold.velocity.data()});
  for (const EnvStatus& status : warm.status) {
    EXPECT_EQ(status.code, EnvCode::solved);
    EXPECT_EQ(status.solver, SolverKind::velocity_newton);
  }
  EXPECT_LE(8 * warm.iterations(), cold.iterations());
}

TEST(VelocityStart, WhereverItIsTheOnlySolutionIsFound) {
  // With R > 0 the convex problem has one solution: a bad start costs steps, and is not seen in the answer.
  const auto batch = chains(Law::convex, 0.05);
  const Answer cold = solve_from(batch, {}, 1e-11);
  for (const double size : {1.0, 1e3, 1e9, 1e100}) {
    SCOPED_TRACE(size);
    scenes::Rng rng(3);
    std::vector<double> start(cold.velocity);
    for (double& velocity : start) velocity = rng.symmetric(size);
    const Answer warm = solve_from(batch, {nullptr, start.data()}, 1e-11);
    for (const EnvStatus& status : warm.status) EXPECT_EQ(status.code, EnvCode::solved);
    for (std::size_t i = 0; i < cold.lambda.size(); ++i)
      EXPECT_NEAR(cold.lambda[i], warm.lambda[i], 1e-8 * (1 + std::abs(cold.lambda[i])));
  }
}

TEST(VelocityStart, ThatHasNoFiniteSquareIsFlaggedAndForgotten) {
  const auto batch = chains();
  const Answer cold = solve_from(batch, {});
  for (const double none : {std::numeric_limits<double>::quiet_NaN(), 1e300}) {
    std::vector<double> start(cold.velocity.size(), 0.0);
    const auto begin = static_cast<std::size_t>(batch.view().env_dof_offsets[7]);
    start[begin + 2] = none;
    const Answer warm = solve_from(batch, {nullptr, start.data()});
    EXPECT_EQ(warm.status[7].flags, static_cast<std::uint32_t>(kFlagWarmStartRejected));
    EXPECT_EQ(warm.status[7].iterations, cold.status[7].iterations);
    EXPECT_EQ(warm.status[8].flags, 0U);
    const auto dofs = static_cast<std::size_t>(batch.view().env_dofs(7));
    EXPECT_TRUE(same_bits(std::span<const double>(cold.velocity).subspan(begin, dofs),
                          std::span<const double>(warm.velocity).subspan(begin, dofs)));
  }
}

TEST(VelocityStart, TheAnswersOwnArraysWillDo) {
  const auto batch = chains();
  const Answer first = solve_from(batch, {}, 1e-4);
  const Answer apart = solve_from(batch, {first.lambda.data(), first.velocity.data()});
  Answer place = first;
  JacobianSolver<double> solver(Device::cpu(), options(SolverKind::automatic, 1e-8, 1000), {});
  solver.solve(batch.view(), place.view(), JacobianStart<double>{place.lambda.data(), place.velocity.data()});
  expect_equal(apart, place);
}

TEST(VelocityStart, OtherArraysOfTheAnswerAreRefusedByName) {
  const auto batch = chains();
  Answer answer(batch.view());
  JacobianSolver<double> solver(Device::cpu(), options(SolverKind::automatic, 1e-8, 1000), {});
  std::vector<double> both(answer.velocity.size() + 1);
  JacobianSolutionView<double> to = answer.view();
  to.velocity = both.data();
  try {
    solver.solve(batch.view(), to, JacobianStart<double>{nullptr, both.data() + 1});
    ADD_FAILURE() << "velocities moved by one";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("start.velocities"), std::string::npos) << error.what();
  }
  EXPECT_THROW(solver.solve(batch.view(), answer.view(), JacobianStart<double>{nullptr, answer.lambda.data()}), Error);
}

TEST(VelocityStart, ASequenceOfProblemsStartsFromReactionsWhereThereAreAny) {
  JacobianBatch<double> batch(Law::coulomb);
  for (std::uint64_t seed = 1; seed <= 20; ++seed)
    batch.add(random_chain({seed, static_cast<Index>(6 + seed % 3), cones_of_every_kind(), 0.0, 0.01}));
  const Answer cold = solve_from(batch, {}, 1e-10);
  const Answer by_reactions = solve_from(batch, {cold.lambda.data(), nullptr});
  const Answer by_both = solve_from(batch, {cold.lambda.data(), cold.velocity.data()});
  expect_equal(by_reactions, by_both);
  const Answer by_velocities = solve_from(batch, {nullptr, cold.velocity.data()});
  for (const EnvStatus& status : by_velocities.status) EXPECT_EQ(status.code, EnvCode::solved);
}

TEST(VelocityStart, WhereItIsTheAnswerNoIterationIsNeeded) {
  const auto batch = chains();
  const Answer cold = solve_from(batch, {}, 1e-10);
  const Answer at_once = solve_from(batch, {nullptr, cold.velocity.data()}, 1e-6, 0);
  for (const EnvStatus& status : at_once.status) {
    EXPECT_EQ(status.code, EnvCode::solved);
    EXPECT_EQ(status.iterations, 0);
  }
}

TEST(VelocityStart, OtherSolversDoNotReadIt) {
  const auto batch = chains();
  const std::vector<double> start(static_cast<std::size_t>(batch.view().dof_count), 3.0);
  JacobianSolver<double> solver(Device::cpu(), options(SolverKind::npgs, 1e-6, 1000), {});
  Answer with(batch.view()), without(batch.view());
  solver.solve(batch.view(), with.view(), JacobianStart<double>{nullptr, start.data()});
  solver.solve(batch.view(), without.view());
  expect_equal(without, with);
}

TEST(VelocityStart, TheEmulatedDeviceHasTheBitsOfTheCpu) {
  const auto batch = chains();
  const RoomyJacobians<double> arrays(batch.view(), 40, 0);
  const auto here = arrays.view(MemorySpace::host), there = arrays.view(MemorySpace::cuda);
  const SolverOptions o = options(SolverKind::automatic, 1e-8, 1000);
  JacobianSolver<double> on_cpu(Device::cpu(), o, {});
  JacobianSolver<double> on_device(Device::emulated(), o, JacobianCapacity::of_largest(here.env_count, 40, 40, 24));
  Answer expected(here), answer(here);
  scenes::Rng rng(3);
  std::vector<double> start(expected.velocity);
  for (double& velocity : start) velocity = rng.symmetric(1.0);
  on_cpu.solve(here, expected.view(), JacobianStart<double>{nullptr, start.data()});
  on_device.solve(there, answer.view(), JacobianStart<double>{nullptr, start.data()});
  on_device.synchronize();
  expect_equal(expected, answer);
}

}  // namespace
