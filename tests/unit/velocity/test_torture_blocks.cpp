#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "stiction/jacobian_solver.hpp"
#include "stiction/residual.hpp"
#include "tests/support/bits.hpp"
#include "tests/support/systems/box_jacobians.hpp"
#include "tests/support/systems/roomy_jacobians.hpp"

/// Torture of environments in blocks: no friction, heavy beside light, redundant rows, rows without effect,
/// NaN.
namespace {

using namespace stiction;
using namespace stiction::test;

using Env = JacobianEnvironment<double>;
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinite = std::numeric_limits<double>::infinity();

Env pyramid(const BoxRecipe& recipe = {.compliance = 1e-3, .push = 1.0}) {
  return boxes_as_jacobian(scenes::box_pyramid(4), recipe);
}
SolverOptions chosen(double tolerance) {
  SolverOptions o = options(SolverKind::automatic, tolerance, 1000);
  o.invalid = InvalidPolicy::isolate;
  return o;
}
template <class Real>
JacobianBatch<Real> batch_of(const std::vector<Env>& envs, Law law) {
  JacobianBatch<Real> batch(law, MassForm::matrix, 6);
  for (const Env& env : envs) batch.add(cast<Real>(env));
  return batch;
}
void expect_solved(const Env& env, Law law, double tolerance) {
  const auto batch = batch_of<double>({env}, law);
  const auto solution = solve(batch, chosen(tolerance));
  EXPECT_EQ(solution.contact.status[0].solver, SolverKind::velocity_newton);
  EXPECT_EQ(solution.contact.status[0].code, EnvCode::solved);
  const auto judged = verify(assemble(batch.view()).view(), std::span<const double>(solution.contact.lambda));
  EXPECT_LE(judged[0].relative, 1.01 * tolerance);
}

TEST(TortureBlocks, NoFriction) {
  for (const Law law : {Law::convex, Law::coulomb}) {
    expect_solved(pyramid({.mu = 0.0, .compliance = 1e-3, .push = 1.0}), law, 1e-6);
    expect_solved(pyramid({.mu = 0.0, .push = 1.0}), law, 1e-6);
  }
}

TEST(TortureBlocks, MassesOneToTenThousand) {
  expect_solved(pyramid({.compliance = 1e-3, .heavy = 1e4, .push = 1.0}), Law::convex, 1e-6);
  expect_solved(pyramid({.compliance = 1e-3, .heavy = 1e-4, .push = 1.0}), Law::convex, 1e-6);
}

TEST(TortureBlocks, EveryContactTwice) {
  Env env = pyramid({.push = 1.0});
  const Env once = env;
  const auto entries = static_cast<Index>(once.J.size());
  env.cones.insert(env.cones.end(), once.cones.begin(), once.cones.end());
  env.J.insert(env.J.end(), once.J.begin(), once.J.end());
  env.column.insert(env.column.end(), once.column.begin(), once.column.end());
  for (std::size_t row = 1; row < once.row_offsets.size(); ++row)
    env.row_offsets.push_back(once.row_offsets[row] + entries);
  env.mu.insert(env.mu.end(), once.mu.begin(), once.mu.end());
  env.R.insert(env.R.end(), once.R.begin(), once.R.end());
  expect_solved(env, Law::convex, 1e-6);
}

/// A cone whose rows touch nothing has no motion to resist, and one that is far open none to take.
TEST(TortureBlocks, ConesThatTouchNothingOrAreFarAway) {
  Env env = pyramid();
  env.target.assign(env.mu.size(), 0.0);
  env.target[3] = -1e3;
  for (Index k = env.row_offsets[6]; k < env.row_offsets[9]; ++k) env.J[static_cast<std::size_t>(k)] = 0.0;
  env.R[6] = env.R[7] = env.R[8] = 0.01;
  expect_solved(env, Law::convex, 1e-6);
}

TEST(TortureBlocks, NothingToDo) {
  Env env = pyramid();
  std::fill(env.v_free.begin(), env.v_free.end(), 0.0);
  const auto solution = solve(batch_of<double>({env}, Law::convex), chosen(1e-9));
  EXPECT_EQ(solution.contact.status[0].code, EnvCode::solved);
  for (const double lambda : solution.contact.lambda) EXPECT_EQ(lambda, 0.0);
  for (const double v : solution.velocity) EXPECT_EQ(v, 0.0);
}

/// Each poison leaves the neighbours' bits alone and ends in a finite answer with a flag, or the status of a solver of
/// A.
template <class Real>
void expect_isolated(const char* what, void (*poison)(Env&)) {
  SCOPED_TRACE(what);
  const std::vector<Env> sound = {pyramid(), pyramid({.compliance = 1e-2, .push = 2.0}), pyramid({.push = 1.0})};
  std::vector<Env> broken = sound;
  poison(broken[1]);
  const auto expected = solve(batch_of<Real>(sound, Law::convex), chosen(1e-4));
  const auto found = solve(batch_of<Real>(broken, Law::convex), chosen(1e-4));
  const std::size_t rows = sound[0].mu.size();
  for (const std::size_t e : {std::size_t{0}, std::size_t{2}}) {
    const auto part = [&](const std::vector<Real>& of) { return std::span<const Real>(of).subspan(e * rows, rows); };
    EXPECT_TRUE(same_bits(part(expected.contact.lambda), part(found.contact.lambda)));
    EXPECT_EQ(found.contact.status[e].solver, SolverKind::velocity_newton);
  }
  EXPECT_NE(found.contact.status[1].code, EnvCode::solved);
  for (const Real lambda : found.contact.lambda) EXPECT_TRUE(std::isfinite(lambda));
}

TEST(TortureBlocks, PoisonStaysInItsEnvironment) {
  expect_isolated<double>("J", [](Env& env) { env.J[40] = kNone; });
  expect_isolated<float>("J", [](Env& env) { env.J[40] = kInfinite; });
  expect_isolated<double>("M", [](Env& env) { env.M[42] = kNone; });
  expect_isolated<double>("indefinite M", [](Env& env) { env.M[36] = -1.0; });
  expect_isolated<double>("v_free", [](Env& env) { env.v_free[5] = kInfinite; });
  expect_isolated<double>("R", [](Env& env) { env.R[3] = kNone; });
}

}  // namespace
