#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "stiction/jacobian_solver.hpp"
#include "stiction/residual.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/systems/roomy_jacobians.hpp"
#include "tests/support/systems/velocity_cases.hpp"

/// Newton's method in velocities where more than 64 degrees of freedom are coupled: bodies that touch one another.
namespace {

using namespace stiction;
using namespace stiction::test;

const BodiesRecipe kRecipes[] = {{1, 12, 3, 0}, {2, 25, 2, 0}, {3, 30, 3, 4}, {4, 80, 2, 0}};

struct Given {
  MassForm form = MassForm::matrix;
  bool stored = false;
};
constexpr Given kGiven[] = {
    {MassForm::matrix, false}, {MassForm::matrix, true}, {MassForm::factor, false}, {MassForm::factor, true}};

JacobianEnvironment<double> given_as(JacobianEnvironment<double> env, const Given& given) {
  if (given.stored) store_nonzeros(env);
  return in_form(env, given.form);
}
/// A factor is eliminated from the first degree of freedom on, so that leaves of a tree must come first.
JacobianEnvironment<double> bodies_for(const Given& given, const BodiesRecipe& recipe) {
  const auto env = bodies_in_contact(recipe);
  return given.form == MassForm::factor ? reversed(env) : env;
}
template <class Real>
JacobianBatch<Real> batch_of(const std::vector<JacobianEnvironment<double>>& envs, Law law, const Given& given) {
  JacobianBatch<Real> batch(law, given.form);
  for (const auto& env : envs) batch.add(cast<Real>(given_as(env, given)));
  return batch;
}

/// The answer is held against A, assembled from M, and the judge that shares no code with solvers.
template <class Real>
void expect_solved(const BodiesRecipe& recipe, Law law, const Given& given, double tolerance) {
  const auto env = bodies_for(given, recipe);
  const auto solution = solve(batch_of<Real>({env}, law, given), options(SolverKind::automatic, tolerance, 2000));
  const EnvStatus& status = solution.contact.status[0];
  EXPECT_EQ(status.solver, SolverKind::velocity_newton) << 6 * recipe.bodies;
  EXPECT_EQ(status.code, EnvCode::solved);
  const auto exact = batch_of<double>({env}, law, {});
  const std::vector<double> lambda(solution.contact.lambda.begin(), solution.contact.lambda.end());
  const auto judged = verify(assemble(exact.view()).view(), std::span<const double>(lambda));
  // In single precision J and M are not quite those of the judge.
  const double rounding = sizeof(Real) == sizeof(float) ? 3e-5 : 1e-11;
  EXPECT_NEAR(judged[0].relative, status.residual, rounding);
  const auto moved = velocities(exact.view(), std::span<const double>(lambda));
  for (std::size_t k = 0; k < moved.size(); ++k)
    EXPECT_NEAR(static_cast<double>(solution.velocity[k]), moved[k], 1e2 * rounding * (1 + std::abs(moved[k])));
}

TEST(VelocityLarge, SolvesBodiesInARowAndInATree) {
  for (const BodiesRecipe& recipe : kRecipes)
    for (const Given& given : kGiven) {
      SCOPED_TRACE("seed " + std::to_string(recipe.seed) + (given.stored ? ", stored" : ", dense") +
                   (given.form == MassForm::matrix ? ", M" : ", its factor"));
      expect_solved<double>(recipe, Law::convex, given, 1e-9);
      expect_solved<float>(recipe, Law::convex, given, 1e-4);
    }
}

TEST(VelocityLarge, ReachesTheOnlySolutionOfACompliantProblem) {
  const auto env = bodies_in_contact(kRecipes[0]);
  const auto points = solve(batch_of<double>({env}, Law::convex, {}), options(SolverKind::ipm, 1e-11, 1000));
  for (const Given& given : kGiven) {
    const auto newton = solve(batch_of<double>({env}, Law::convex, given), options(SolverKind::automatic, 1e-11, 1000));
    ASSERT_EQ(newton.contact.status[0].solver, SolverKind::velocity_newton);
    for (std::size_t i = 0; i < newton.contact.lambda.size(); ++i)
      EXPECT_NEAR(newton.contact.lambda[i], points.contact.lambda[i], 1e-8 * (1 + std::abs(points.contact.lambda[i])));
  }
}

TEST(VelocityLarge, ThreadsAndNeighboursReachNoBit) {
  for (const Given& given : kGiven) {
    std::vector<JacobianEnvironment<double>> envs;
    for (std::uint64_t seed = 1; seed <= 9; ++seed)
      envs.push_back(seed % 3 == 0 ? random_chain({seed, 20}) : bodies_for(given, {seed, 10 + seed, 3, seed % 4}));
    SolverOptions o = options(SolverKind::automatic, 1e-8, 1000);
    const auto one = solve(batch_of<double>(envs, Law::convex, given), o);
    o.threads = 3;
    const auto three = solve(batch_of<double>(envs, Law::convex, given), o);
    EXPECT_TRUE(same_bits(one.contact, three.contact));
    EXPECT_TRUE(same_bits(std::span<const double>(one.velocity), std::span<const double>(three.velocity)));
    std::size_t row = 0;
    for (std::size_t e = 0; e < envs.size(); ++e) {
      EXPECT_EQ(one.contact.status[e].solver, SolverKind::velocity_newton);
      const auto alone = solve(batch_of<double>({envs[e]}, Law::convex, given), o);
      const auto own = std::span<const double>(one.contact.lambda).subspan(row, envs[e].mu.size());
      EXPECT_TRUE(same_bits(std::span<const double>(alone.contact.lambda), own)) << "env " << e;
      row += envs[e].mu.size();
    }
  }
}

// Few rows make a small A; many that are coupled all with all, or do not fit, make a step that is too large.
TEST(VelocityLarge, WhatDoesNotPayIsSolvedByA) {
  for (const auto& env :
       {random_jacobian({1, 10, 5, 200}), bodies_in_contact({1, 12, 1}), bodies_in_contact({1, 86, 1})}) {
    const auto solution = solve(batch_of<double>({env}, Law::convex, {}), options(SolverKind::automatic, 1e-6, 2000));
    EXPECT_EQ(solution.contact.status[0].code, EnvCode::solved);
    EXPECT_NE(solution.contact.status[0].solver, SolverKind::velocity_newton);
  }
}

}  // namespace
