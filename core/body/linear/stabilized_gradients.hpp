#pragma once

#include "core/body/linear/conjugate_gradient.hpp"

namespace stiction::inline STICTION_ISA {

/// Vectors of 6 `rows` doubles that stabilized gradients keep.
inline constexpr Index kStabilizedVectors = 7;

/// Solves A x = b from x = 0 for an A that need not be symmetric, by biconjugate gradients stabilized (van der Vorst
/// 1992), preconditioned from the right, until the residual is `tolerance` times b in length or `most` iterations are
/// done. A breakdown ends it: x is then what there is. The outcome is on every lane. The preconditioner is as for
/// solve_gradients, and has room of its own apart from `memory`.
template <Block B, class Preconditioner>
STICTION_HD_OUTLINE GradientOutcome solve_stabilized(B& block, const BlockMatrix& A,
                                                     const Preconditioner& preconditioner, const double* b, double* x,
                                                     double* memory, double tolerance, Index most) {
  const Index n = A.pattern.rows * kBodyBlock;
  double* const r = memory;
  double* const shadow = r + n;
  double* const p = shadow + n;
  double* const v = p + n;
  double* const t = v + n;
  double* const p_hat = t + n;
  double* const r_hat = p_hat + n;
  for_each(block, n, [&](Index i) {
    x[i] = 0.0;
    r[i] = shadow[i] = p[i] = b[i];
  });
  double rho = dot_product(block, n, shadow, r);
  const double enough = (tolerance * tolerance) * rho;
  GradientOutcome outcome;
  outcome.is_met = !(rho > enough);
  while (!outcome.is_met && outcome.iterations < most) {
    preconditioner.apply(block, p, p_hat);
    multiply_blocks(block, A, p_hat, v);
    const double along = dot_product(block, n, shadow, v);
    if (!(abs_(along) > 0.0)) break;
    const double alpha = div_(rho, along);
    for_each(block, n, [&](Index i) { r[i] = fma_(0.0 - alpha, v[i], r[i]); });
    preconditioner.apply(block, r, r_hat);
    multiply_blocks(block, A, r_hat, t);
    const double square = dot_product(block, n, t, t);
    const double omega = square > 0.0 ? div_(dot_product(block, n, t, r), square) : 0.0;
    for_each(block, n, [&](Index i) {
      x[i] = fma_(omega, r_hat[i], fma_(alpha, p_hat[i], x[i]));
      r[i] = fma_(0.0 - omega, t[i], r[i]);
    });
    ++outcome.iterations;
    outcome.is_met = !(dot_product(block, n, r, r) > enough);
    const double next = dot_product(block, n, shadow, r);
    if (!(abs_(omega * next) > 0.0)) break;
    const double beta = div_(next, rho) * div_(alpha, omega);
    rho = next;
    for_each(block, n, [&](Index i) { p[i] = fma_(beta, fma_(0.0 - omega, v[i], p[i]), r[i]); });
  }
  return outcome;
}

}  // namespace stiction::inline STICTION_ISA
