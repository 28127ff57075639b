#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/support/oracles/certificate.hpp"
#include "tests/support/systems/small_systems.hpp"

/// Matrices beyond the usual 1024 rows, where the caller asks for them.
namespace {

using namespace stiction;
using namespace stiction::test;

/// A chain of half lines, each coupled to the next, of which every fortieth is pressed.
Environment<double> chain(Index rows) {
  Environment<double> env;
  for (Index i = 0; i < rows; ++i) {
    env.cones.push_back(unilateral());
    for (Index j = i - 1; j <= i + 1; ++j)
      if (j >= 0 && j < rows) {
        env.column.push_back(j);
        env.A.push_back(i == j ? 2 : -0.5);
      }
    env.row_offsets.push_back(static_cast<Index>(env.column.size()));
    env.b.push_back(i % 40 == 20 ? -1 : 0.5);
  }
  return env;
}

TEST(DirectRows, PivotingRefusesWhatItHasNoMatrixForAndTakesItWhenAsked) {
  const Environment<double> env = chain(1030);
  SolverOptions o = options(SolverKind::lemke, 1e-10, 4000);
  const Solution<double> refused = solve(batch_of({env}), o);
  EXPECT_EQ(refused.status[0].code, EnvCode::unsupported);
  EXPECT_EQ(refused.status[0].flags, static_cast<std::uint32_t>(kFlagOverCapacity));
  o.direct_rows = 1030;
  const Solution<double> solution = solve(batch_of({env}), o);
  EXPECT_EQ(solution.status[0].code, EnvCode::solved) << solution.status[0].residual;
  EXPECT_LE(certify(env, Law::convex, solution.lambda).worst(), 1e-9L);
}

TEST(DirectRows, BothWaysOfAMethodHaveTheSameAnswer) {
  const Environment<double> env = chain(1030);
  SolverOptions o = options(SolverKind::admm, 1e-9, 1000);
  const Solution<double> by_gradients = solve(batch_of({env}), o);
  o.direct_rows = 2048;
  const Solution<double> by_matrix = solve(batch_of({env}), o);
  EXPECT_EQ(by_gradients.status[0].code, EnvCode::solved) << by_gradients.status[0].residual;
  EXPECT_EQ(by_matrix.status[0].code, EnvCode::solved) << by_matrix.status[0].residual;
  // A's eigenvalues are at least one: reactions are as near as residuals.
  for (std::size_t i = 0; i < env.b.size(); ++i)
    EXPECT_NEAR(by_matrix.lambda[i], by_gradients.lambda[i], 1e-6) << "row " << i;
  EXPECT_NE(by_matrix.lambda, by_gradients.lambda) << "one way was taken twice";
}

}  // namespace
