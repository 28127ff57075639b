#include <gtest/gtest.h>

#include "stiction/error.hpp"
#include "tests/support/oracles/hand_answers.hpp"
#include "tests/support/systems/small_systems.hpp"

namespace {

using namespace stiction;
using namespace stiction::test;

constexpr SolverKind kSolver = SolverKind::apgd;

TEST(Apgd, SmallSystemsHaveTheAnswersWorkedOutByHand) {
  expect_hand_answers(kSolver, 1e-10, 4000);
}

TEST(Apgd, ASystemThatIsNotSymmetricIsRefusedWithItsFlag) {
  const auto refused = system({unilateral(), unilateral()}, {2, -1, 0, 2}, {-1, -2});
  const Solution<double> solution = solve(batch_of({refused}), options(kSolver, 1e-6, 100));
  EXPECT_EQ(solution.status[0].code, EnvCode::unsupported);
  EXPECT_EQ(solution.status[0].flags, static_cast<std::uint32_t>(kFlagAsymmetric));
  EXPECT_EQ(solution.lambda, (std::vector<double>{0, 0}));
  EXPECT_EQ(solution.w, refused.b);
}

TEST(Apgd, TheAsymmetryOfRealFilesIsAccepted) {
  // 1e-3 of the largest entry, as recorded systems have it; 1e-2 is the limit.
  const auto accepted = system({unilateral(), unilateral()}, {2, 1, 1.002, 2}, {-1, -2});
  EXPECT_EQ(solve(batch_of({accepted}), options(kSolver, 1e-9, 500)).status[0].code, EnvCode::solved);
  const auto refused = system({unilateral(), unilateral()}, {2, 1, 1.03, 2}, {-1, -2});
  EXPECT_EQ(solve(batch_of({refused}), options(kSolver, 1e-9, 500)).status[0].code, EnvCode::unsupported);
}

TEST(Apgd, TheSparsePathRefusesWhatIsNotSymmetricToo) {
  // A hundred rows in a ring, each pulled by the one before and pulling none.
  constexpr Index kRows = 100;
  Environment<double> env;
  for (Index i = 0; i < kRows; ++i) {
    env.cones.push_back(unilateral());
    env.column.insert(env.column.end(), {i, (i + 1) % kRows});
    env.A.insert(env.A.end(), {2.0, -1.0});
    env.row_offsets.push_back(2 * (i + 1));
    env.b.push_back(-1);
  }
  const Solution<double> solution = solve(batch_of({env}), options(kSolver, 1e-6, 100));
  EXPECT_EQ(solution.status[0].code, EnvCode::unsupported);
  EXPECT_NE(solution.status[0].flags & kFlagAsymmetric, 0U);
}

TEST(Apgd, MassesAMillionApartAreEvenedOutByThePreconditioner) {
  const auto env = system({unilateral(), unilateral()}, diagonal({1, 1e-6}), {-1, -1});
  const Solution<double> solution = solve(batch_of({env}), options(kSolver, 1e-12, 100));
  EXPECT_EQ(solution.status[0].code, EnvCode::solved) << solution.status[0].residual;
}

}  // namespace
