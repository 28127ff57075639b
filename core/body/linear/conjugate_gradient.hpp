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

/// Vectors of 6 `rows` doubles that conjugate gradients keep.
inline constexpr Index kGradientVectors = 4;

struct GradientOutcome {
  Index iterations = 0;
  bool is_met = false;  ///< whether the tolerance was
};

/// Solves A x = b from x = 0 by preconditioned conjugate gradients (Golub and Van Loan 2013, algorithm 11.5.1), until
/// the residual, in the norm that the preconditioner M^-1 makes, is `tolerance` times its first value, or `most`
/// iterations are done. `memory` has room for kGradientVectors. A direction without curvature ends it: A is then not
/// positive definite to working precision, and x is the best there is. The outcome is on every lane.
///
/// A preconditioner has `template <Block B> void apply(B&, const double* r, double* z) const`, z = M^-1 r with M
/// symmetric positive definite and z, r apart.
template <Block B, class Preconditioner>
STICTION_HD_OUTLINE GradientOutcome solve_gradients(B& block, const BlockMatrix& A,
                                                    const Preconditioner& preconditioner, const double* b, double* x,
                                                    double* memory, double tolerance, Index most) {
  const Index n = A.pattern.rows * kBodyBlock;
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
    multiply_blocks(block, A, p, q);
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

}  // namespace stiction::inline STICTION_ISA
