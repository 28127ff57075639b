#pragma once

#include "core/body/linear/block_matrix.hpp"

namespace stiction::inline STICTION_ISA {

/// v'w over n numbers, in the order of leaves whoever sums.
template <Block B>
STICTION_HD_OUTLINE double dot_product(B& block, Index n, const double* v, const double* w) {
  return sum_leaves<double>(block, [&](Index leaf) {
    double sum = 0.0;
    for (Index i = leaf; i < n; i += kReduceLeaves) sum = fma_(v[i], w[i], sum);
    return sum;
  });
}

/// Vectors of n doubles that conjugate gradients for n unknowns keep.
inline constexpr Index kGradientVectors = 4;

struct GradientOutcome {
  Index iterations = 0;
  bool is_met = false;  ///< whether the tolerance was
};

/// Solves A x = b for n unknowns from x = 0 by preconditioned conjugate gradients (Golub and Van Loan 2013,
/// algorithm 11.5.1), until the residual, in the norm that the preconditioner M^-1 makes, is `tolerance` times its
/// first value, or `most` iterations are done. `memory` has room for kGradientVectors. A direction without curvature
/// ends it: A is then not positive definite to working precision. However it ends, x is the best there was: each
/// iterate is nearer to the solution than the last in the norm that A makes. The outcome is on every lane.
///
/// An operator has `template <Block B> void apply(B&, const double* v, double* w) const`, w = A v with w, v apart; a
/// preconditioner has the same, z = M^-1 r with M symmetric positive definite.
template <Block B, class Operator, class Preconditioner>
STICTION_HD_OUTLINE GradientOutcome solve_gradients(B& block, Index n, const Operator& A,
                                                    const Preconditioner& preconditioner, const double* b, double* x,
                                                    double* memory, double tolerance, Index most) {
  double* const r = memory;
  double* const z = r + n;
  double* const p = z + n;
  double* const q = p + n;
  for_each(block, n, [&](Index i) {
    x[i] = 0.0;
    r[i] = b[i];
  });
  preconditioner.apply(block, r, z);
  for_each(block, n, [&](Index i) { p[i] = z[i]; });
  double energy = dot_product(block, n, r, z);
  const double enough = (tolerance * tolerance) * energy;
  GradientOutcome outcome;
  outcome.is_met = !(energy > enough);
  while (!outcome.is_met && outcome.iterations < most) {
    A.apply(block, p, q);
    const double curvature = dot_product(block, n, p, q);
    if (!(curvature > 0.0)) break;
    const double alpha = div_(energy, curvature);
    for_each(block, n, [&](Index i) {
      x[i] = fma_(alpha, p[i], x[i]);
      r[i] = fma_(0.0 - alpha, q[i], r[i]);
    });
    preconditioner.apply(block, r, z);
    const double next = dot_product(block, n, r, z);
    const double beta = div_(next, energy);
    energy = next;
    ++outcome.iterations;
    outcome.is_met = !(energy > enough);
    for_each(block, n, [&](Index i) { p[i] = fma_(beta, p[i], z[i]); });
  }
  return outcome;
}

/// A block matrix as an operator.
struct BlockOperator {
  BlockMatrix A;
  template <Block B>
  STICTION_HD void apply(B& block, const double* v, double* w) const {
    multiply_blocks(block, A, v, w);
  }
};

/// The same for a block matrix.
template <Block B, class Preconditioner>
STICTION_HD GradientOutcome solve_gradients(B& block, const BlockMatrix& A, const Preconditioner& preconditioner,
                                            const double* b, double* x, double* memory, double tolerance, Index most) {
  return solve_gradients(block, A.pattern.rows * kBodyBlock, BlockOperator{A}, preconditioner, b, x, memory, tolerance,
                         most);
}

}  // namespace stiction::inline STICTION_ISA
