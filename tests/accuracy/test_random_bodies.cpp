#include <gtest/gtest.h>

#if defined(STICTION_TEST_HAS_RAPIDCHECK)
#include <rapidcheck.h>

#include "tests/support/oracles/random_always.hpp"
#include "tests/support/oracles/random_checks.hpp"
#include "tests/support/systems/body_systems.hpp"

/// Properties of any bodies and contacts thrown together, for each way to solve them.
namespace stiction::test {
namespace {

constexpr double kTolerance = 1e-8;

struct Way {
  BodyMethod method;
  BodyPreconditioner preconditioner;  ///< read by Newton's method
  bool momentum;                      ///< read by sweeps
};

std::string name_of(const testing::TestParamInfo<Way>& way) {
  if (way.param.method == BodyMethod::newton) return std::string("newton_") + to_string(way.param.preconditioner);
  return way.param.momentum ? "impulses_with_momentum" : "impulses";
}

BodySolverOptions options_of(const Way& way, Law law) {
  BodySolverOptions options = newton_options(law, way.preconditioner);
  options.method = way.method;
  options.momentum = way.momentum;
  options.iterations = way.method == BodyMethod::newton ? 500 : 500000;
  options.tolerance = kTolerance;
  return options;
}

BodyEnvironment<double> any_bodies() {
  const auto seed = *rc::gen::arbitrary<std::uint64_t>();
  const int bodies = *rc::gen::inRange(2, 6);
  return random_bodies(seed, bodies, *rc::gen::inRange(1, 10));
}

/// A contact that gives way by a hundredth of a kilogram's motion.
TimeStepping compliant() {
  TimeStepping stepping;
  stepping.cfm = 0.01 * stepping.dt;
  return stepping;
}

/// An answer against the assembled system: the judge, the cones, and twists that the impulses explain.
std::string body_violation(const BodyEnvironment<double>& env, const BodySolution<double>& solution, Law law,
                           const TimeStepping& stepping) {
  std::ostringstream out;
  const Environment<double> system = scenes::delassus_form(env, stepping);
  const auto batch = batch_of({system}, law);
  const Residual judged = verify(batch.view(), std::span<const double>(solution.impulse)).at(0);
  const EnvStatus& status = solution.status[0];
  // The solver sums body by body, the judge row by row.
  const double bound = 2 * residual_rounding(batch.view(), 0, solution.impulse);
  const double rounding = bound > 0 ? bound / judged.scale : 0;
  if (std::abs(judged.relative - status.residual) > rounding + 1e-12)
    out << "status says residual " << status.residual << ", the judge " << judged.relative << "; ";
  if (status.code == EnvCode::solved && judged.relative > kTolerance + rounding + 1e-12)
    out << "`solved` at a residual of " << judged.relative << "; ";
  out << cone_violation(system, solution.impulse);

  const scenes::BodyMatrices m = scenes::body_matrices(env);
  const auto rows = static_cast<std::size_t>(m.rows), dofs = static_cast<std::size_t>(m.dofs);
  for (std::size_t i = 0; i < dofs; ++i) {
    double v = m.v_free[i], size = std::abs(v);
    for (std::size_t k = 0; k < dofs; ++k)
      for (std::size_t row = 0; row < rows; ++row) {
        const double term = m.inv_M[i * dofs + k] * m.J[row * dofs + k] * solution.impulse[row];
        v += term;
        size += std::abs(term);
      }
    // Some hundred terms at most, each rounded a few times.
    if (std::abs(solution.twist[i] - v) > 1e-13 * size)
      out << "twist " << i << " is " << solution.twist[i] << ", its impulses make it " << v << "; ";
  }
  return out.str();
}

using BodyWays = testing::TestWithParam<Way>;

TEST_P(BodyWays, UnderTheConvexLawWithComplianceBodiesMoveAsTheOracleSays) {
  expect_always(true, [&](std::string& unsolved) {
    const BodyEnvironment<double> env = any_bodies();
    const auto solution = solve_bodies(batch_of<double>({env}), compliant(), options_of(GetParam(), Law::convex));
    std::string out = body_violation(env, solution, Law::convex, compliant());
    if (solution.status[0].code != EnvCode::solved)
      unsolved = std::string("not solved: ") + to_string(solution.status[0].code) + "; ";
    const Environment<double> system = scenes::delassus_form(env, compliant());
    const oracle::Answer truth = oracle::solve_convex(system);
    if (!truth.converged) return out + "the oracle did not converge; ";
    const auto batch = batch_of({system}, Law::convex);
    const Residual oracle_residual = verify(batch.view(), std::span<const double>(truth.lambda)).at(0);
    const MotionBound motion = motion_bound(batch.view(), 0, solution.impulse, solution.status[0].residual_absolute,
                                            truth.lambda, oracle_residual.absolute);
    if (!(motion.difference <= motion.bound)) out += "motion differs by more than the residuals explain; ";
    return out;
  });
}

TEST_P(BodyWays, UnderCoulombsLawAnswersAreHonest) {
  expect_always(false, [&](std::string&) {
    const BodyEnvironment<double> env = any_bodies();
    BodySolverOptions options = options_of(GetParam(), Law::coulomb);
    options.iterations = 300;
    return body_violation(env, solve_bodies(batch_of<double>({env}), compliant(), options), Law::coulomb, compliant());
  });
}

constexpr Way newton_by(BodyPreconditioner preconditioner) {
  return {BodyMethod::newton, preconditioner, true};
}

INSTANTIATE_TEST_SUITE_P(
    Random, BodyWays,
    testing::Values(Way{BodyMethod::impulses, BodyPreconditioner::factor, true},
                    Way{BodyMethod::impulses, BodyPreconditioner::factor, false},
                    newton_by(BodyPreconditioner::diagonal), newton_by(BodyPreconditioner::block_diagonal),
                    newton_by(BodyPreconditioner::incomplete_cholesky), newton_by(BodyPreconditioner::sparse_inverse),
                    newton_by(BodyPreconditioner::factor), newton_by(BodyPreconditioner::multigrid)),
    name_of);

}  // namespace
}  // namespace stiction::test

#else

TEST(RandomBodies, NeedRapidcheck) {
  GTEST_SKIP() << "built without rapidcheck (Debian: librapidcheck-dev)";
}

#endif
