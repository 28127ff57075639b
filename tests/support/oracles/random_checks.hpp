#pragma once

#include <cmath>
#include <cstdlib>
#include <span>
#include <sstream>
#include <string>
#include <vector>

#include "stiction/residual.hpp"
#include "tests/support/oracles/motion_bound.hpp"
#include "tests/support/oracles/oracle.hpp"
#include "tests/support/oracles/rounding_bound.hpp"
#include "tests/support/systems/random_systems.hpp"
#include "tests/support/systems/small_systems.hpp"

/// Checks of any solver on any well-posed system, as text: empty, or the first thing that did not hold.
namespace stiction::test {

/// Every run draws another seed, and rapidcheck prints it: RC_PARAMS="seed=... max_success=60" repeats a run.
inline const int kCases = setenv("RC_PARAMS", "max_success=60", 0);

/// Says if lambda leaves its cones by more than rounding.
inline std::string cone_violation(const Environment<double>& env, const std::vector<double>& lambda) {
  std::ostringstream out;
  std::size_t row = 0;
  for (const auto& cone : env.cones) {
    const auto m = static_cast<std::size_t>(cone.row_count);
    const double x = lambda[row];
    if (cone.kind == ConeKind::unilateral && x < 0) out << "unilateral row " << row << " = " << x << "; ";
    if (cone.kind == ConeKind::box) {
      // Bounds pass through two exact scalings by powers of two, so they hold to the bit.
      if (x < env.lo[row] || x > env.hi[row]) out << "box row " << row << " = " << x << "; ";
    }
    if (cone.kind == ConeKind::friction) {
      double sum = 0.0;
      for (std::size_t k = 1; k < m; ++k) {
        const double mu = env.mu.empty() ? 0.0 : env.mu[row + k];
        if (mu == 0.0 && lambda[row + k] != 0.0) out << "reaction on the frictionless row " << row + k << "; ";
        if (mu > 0.0) sum += lambda[row + k] / mu * (lambda[row + k] / mu);
      }
      // A projection, a product with mu and a quotient by it: each rounds once per row, a few ulps in all.
      if (x < 0 || std::sqrt(sum) > x * (1 + 1e-14)) out << "friction cone at row " << row << "; ";
    }
    row += m;
  }
  return out.str();
}

/// A solver's answer to one system, against the judge and the cones.
inline std::string answer_violation(const Environment<double>& env, Law law, const SolverOptions& o,
                                    Solution<double>& solution) {
  const auto batch = batch_of({env}, law);
  solution = solve(batch, o);
  std::ostringstream out;
  for (const auto* values : {&solution.lambda, &solution.w})
    for (const double value : *values)
      if (!std::isfinite(value)) out << "an output is not finite; ";
  const Residual judged = verify(batch.view(), std::span<const double>(solution.lambda)).at(0);
  const EnvStatus& status = solution.status[0];
  const double bound = residual_rounding(batch.view(), 0, solution.lambda);
  const double rounding = bound > 0.0 ? bound / judged.scale : 0.0;  // infinite where no contact has an error
  if (std::abs(judged.relative - status.residual) > rounding)
    out << "status says residual " << status.residual << ", the judge " << judged.relative << "; ";
  if (status.code == EnvCode::solved && judged.relative > o.tolerance + rounding)
    out << "`solved` at a residual of " << judged.relative << "; ";
  if (status.code != EnvCode::solved && status.code != EnvCode::max_iterations && status.code != EnvCode::stalled &&
      status.code != EnvCode::rounding)
    out << "ended as " << to_string(status.code) << "; ";
  out << cone_violation(env, solution.lambda);
  return out.str();
}

/// Returns empty text if the solver reports a solution, which exists and which it is able to find.
inline std::string unsolved_text(const Solution<double>& solution) {
  const EnvStatus& status = solution.status[0];
  if (status.code == EnvCode::solved) return {};
  std::ostringstream out;
  out << "not solved: " << to_string(status.code) << " after " << status.iterations << " iterations of "
      << to_string(status.solver) << " at a residual of " << status.residual << "; ";
  return out.str();
}

/// And against the oracle, in its unique part: the motion, under the convex law. `unsolved` says whether it was solved.
inline std::string convex_violation(const Environment<double>& env, const SolverOptions& o, std::string& unsolved) {
  Solution<double> solution;
  std::string out = answer_violation(env, Law::convex, o, solution);
  unsolved = unsolved_text(solution);
  const oracle::Answer truth = oracle::solve_convex(env);
  if (!truth.converged) return out + "the oracle did not converge; ";
  const auto batch = batch_of({env}, Law::convex);
  const Residual oracle_residual = verify(batch.view(), std::span<const double>(truth.lambda)).at(0);
  const MotionBound motion = motion_bound(batch.view(), 0, solution.lambda, solution.status[0].residual_absolute,
                                          truth.lambda, oracle_residual.absolute);
  if (!(motion.difference <= motion.bound)) {
    std::ostringstream more;
    more << "motion differs by " << motion.difference << ", the residuals explain " << motion.bound << "; ";
    out += more.str();
  }
  return out;
}

/// Against the oracle under the Coulomb law, on a system whose solution is unique (mu sqrt(condition) < 1).
///
/// Distance that a residual r lets w stray:
///
/// * The convex map is Lipschitz with the condition number in circular coordinates. This is 9 / 0.03^2 = 1e4 for mu of
///   0.03 to 0.3 and a condition of 9.
/// * de Saxce's fixed point contracts by 0.9, which adds a factor 1 / (1 - 0.9).
/// * w_t = y_t / mu adds 1 / 0.03.
///
/// Together 3.3e6: at residuals of 1e-10 w is held to some 1e-4, where the other law's w differs by mu norm(w_t), some
/// 1e-1.
inline constexpr double kCoulombAmplification = 3.3e6;

inline std::string coulomb_violation(const Environment<double>& env, const SolverOptions& o, std::string& unsolved) {
  Solution<double> solution;
  std::string out = answer_violation(env, Law::coulomb, o, solution);
  unsolved = unsolved_text(solution);
  const oracle::Answer truth = oracle::solve_coulomb(env);
  if (!truth.converged) return out + "the oracle did not converge; ";
  const auto batch = batch_of({env}, Law::coulomb);
  const double residuals =
      solution.status[0].residual_absolute + verify(batch.view(), std::span<const double>(truth.lambda)).at(0).absolute;
  for (std::size_t i = 0; i < env.b.size(); ++i) {
    const double difference = std::abs(solution.w[i] - truth.w[i]);
    // Below is the rounding of w itself, a sum of some ten terms of order one.
    if (difference > kCoulombAmplification * residuals + 1e-14) {
      std::ostringstream more;
      more << "w of row " << i << " is " << solution.w[i] << ", the oracle's " << truth.w[i] << " at a residual of "
           << solution.status[0].residual << "; ";
      return out + more.str();
    }
  }
  return out;
}

}  // namespace stiction::test
