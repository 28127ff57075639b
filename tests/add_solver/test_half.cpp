#include <gtest/gtest.h>

#include "stiction/status.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/systems/scene_batches.hpp"
#include "tests/support/systems/small_systems.hpp"

/// The example of docs/tutorials/writing_a_solver.md. This file is not built here: add_solver.py adds it to a copy of
/// the tree, together with the solver.
namespace {

using namespace stiction;
using namespace stiction::test;

std::vector<double> iterate(const Environment<double>& env, Index iterations, const Device& device) {
  return solve(batch_of({env}), options(SolverKind::half, 0, iterations), device).lambda;
}

TEST(Half, ItHasANameAndTheLastNumber) {
  EXPECT_STREQ(to_string(SolverKind::half), "half");
  EXPECT_EQ(solver_from_string("half"), SolverKind::half);
  EXPECT_EQ(static_cast<int>(SolverKind::half), kSolverKindCount - 1);
}

TEST(Half, EveryStepIsHalfOfWhatTheOwnBlockAllows) {
  // x <- x - (1/2) (1/2) (2 x - 3): the distance to 1.5 is halved, in numbers that have no rounding.
  const auto one = system({unilateral()}, {2}, {-3});
  // x <- x - (1/2) (1/2) (2 x_i + x_j - 2) at once: 1/2, then 1/2 + (1/4) (1/2).
  const auto two = system({unilateral(), unilateral()}, {2, 1, 1, 2}, {-2, -2});
  for (const Device& device : {Device::cpu(), Device::emulated()}) {
    EXPECT_EQ(iterate(one, 1, device), (std::vector<double>{0.75}));
    EXPECT_EQ(iterate(one, 3, device), (std::vector<double>{1.3125}));
    EXPECT_EQ(iterate(two, 2, device), (std::vector<double>{0.625, 0.625}));
    const auto status = solve(batch_of({one}), options(SolverKind::half, 1e-9, 100), device).status[0];
    EXPECT_EQ(status.code, EnvCode::solved);
    EXPECT_EQ(status.solver, SolverKind::half);
  }
}

template <class Real>
void expect_the_same_bits(Law law) {
  const ContactBatch<Real> batch = convert<Real>(scene_batch("grasp", 3, 7));
  SolverOptions few = options(SolverKind::half, 0, 20);
  few.law = law;
  EXPECT_TRUE(same_bits(solve(batch, few), solve(batch, few, Device::emulated()))) << to_string(law);
}

TEST(Half, TheEmulatedDeviceGivesTheBitsOfTheCpu) {
  for (const Law law : kBothLaws) {
    expect_the_same_bits<float>(law);
    expect_the_same_bits<double>(law);
  }
}

TEST(Half, TheTestsOfAllSolversTakeItIn) {
  EXPECT_EQ(kEverySolver.back(), SolverKind::half);
  EXPECT_EQ(kAllSolvers.back(), SolverKind::half);
}

}  // namespace
