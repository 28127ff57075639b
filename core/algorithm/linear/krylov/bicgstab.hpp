#pragma once

#include "core/algorithm/linear/krylov/cg.hpp"

namespace stiction::inline STICTION_ISA {

/// Vectors that stabilized gradients keep.
inline constexpr Index kStabilizedVectors = 7;

/// Biconjugate gradients stabilized (van der Vorst 1992) for an A that need not be symmetric, preconditioned from the
/// right, in kStabilizedVectors vectors. The residual is measured by its length. A breakdown ends it: x is then the
/// last iterate. The outcome is on every lane.
template <Team TeamT, class Operator, class Preconditioner>
STICTION_HD_OUTLINE GradientOutcome bicgstab(TeamT& team, const Operator& A, const KrylovProblem& problem,
                                             const Preconditioner& preconditioner) {
  const Index n = problem.unknowns;
  double* const x = problem.x;
  double* const r = problem.vector(0);
  double* const shadow = problem.vector(1);
  double* const p = problem.vector(2);
  double* const v = problem.vector(3);
  double* const t = problem.vector(4);
  double* const p_hat = problem.vector(5);
  double* const r_hat = problem.vector(6);
  for_each(team, n, [&](Index i) {
    x[i] = 0.0;
    r[i] = shadow[i] = p[i] = problem.b[i];
  });
  double rho = dot_product(team, n, shadow, r);
  const double enough = (problem.tolerance * problem.tolerance) * rho;
  GradientOutcome outcome;
  outcome.is_met = !(rho > enough);
  while (!outcome.is_met && outcome.iterations < problem.most) {
    preconditioner.apply(team, p, p_hat);
    A.apply(team, p_hat, v);
    const double along = dot_product(team, n, shadow, v);
    if (!(abs_(along) > 0.0)) break;
    const double alpha = div_(rho, along);
    for_each(team, n, [&](Index i) { r[i] = fma_(0.0 - alpha, v[i], r[i]); });
    preconditioner.apply(team, r, r_hat);
    A.apply(team, r_hat, t);
    const double square = dot_product(team, n, t, t);
    const double omega = square > 0.0 ? div_(dot_product(team, n, t, r), square) : 0.0;
    for_each(team, n, [&](Index i) {
      x[i] = fma_(omega, r_hat[i], fma_(alpha, p_hat[i], x[i]));
      r[i] = fma_(0.0 - omega, t[i], r[i]);
    });
    ++outcome.iterations;
    outcome.is_met = !(dot_product(team, n, r, r) > enough);
    const double next = dot_product(team, n, shadow, r);
    if (!(abs_(omega * next) > 0.0)) break;
    const double beta = div_(next, rho) * div_(alpha, omega);
    rho = next;
    for_each(team, n, [&](Index i) { p[i] = fma_(beta, fma_(0.0 - omega, v[i], p[i]), r[i]); });
  }
  return outcome;
}

}  // namespace stiction::inline STICTION_ISA
