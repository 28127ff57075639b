#pragma once

#include "core/algorithm/linear/block/block_matrix.hpp"

namespace stiction::inline STICTION_ISA {

/// v'w over n numbers, in the order of leaves on every team.
template <Team TeamT>
STICTION_HD_OUTLINE double dot_product(TeamT& team, Index n, const double* v, const double* w) {
  return sum_leaves<double>(team, [&](Index leaf) {
    double sum = 0.0;
    for (Index i = leaf; i < n; i += kReduceLeaves) sum = fma_(v[i], w[i], sum);
    return sum;
  });
}

/// Vectors that conjugate gradients keep.
inline constexpr Index kGradientVectors = 4;

struct GradientOutcome {
  Index iterations = 0;
  bool is_met = false;  ///< whether the tolerance was
};

/// Arguments of a method of gradients, which solves A x = b from x = 0. It ends when its residual is `tolerance` times
/// the first or `most` iterations are done. The norm, and the number of vectors kept, are the method's.
///
/// The operator A has `template <Team B> void apply(B&, const double* v, double* w) const`, w = A v with v and w
/// apart. A preconditioner has the same, z = M^-1 r with M symmetric positive definite. Each has separate room.
struct KrylovProblem {
  Index unknowns;
  const double* b;  ///< (unknowns)
  double* x;        ///< the answer                                 (unknowns)
  double* memory;   ///< the method's vectors, `unknowns` doubles each
  double tolerance;
  Index most;

  [[nodiscard]] STICTION_HD double* vector(Index k) const { return memory + static_cast<Offset>(k) * unknowns; }
};

/// Preconditioned conjugate gradients (Golub and Van Loan 2013, algorithm 11.5.1) in kGradientVectors vectors. The
/// residual is measured in the norm that M^-1 makes. A direction without curvature ends it: A is then not positive
/// definite to working precision. However it ends, x is the best there was: each iterate is nearer to the solution
/// than the last in the norm that A makes. The outcome is on every lane.
template <Team TeamT, class Operator, class Preconditioner>
STICTION_HD_OUTLINE GradientOutcome conjugate_gradient(TeamT& team, const Operator& A, const KrylovProblem& problem,
                                                       const Preconditioner& preconditioner) {
  const Index n = problem.unknowns;
  double* const x = problem.x;
  double* const r = problem.vector(0);
  double* const z = problem.vector(1);
  double* const p = problem.vector(2);
  double* const q = problem.vector(3);
  for_each(team, n, [&](Index i) {
    x[i] = 0.0;
    r[i] = problem.b[i];
  });
  preconditioner.apply(team, r, z);
  for_each(team, n, [&](Index i) { p[i] = z[i]; });
  double energy = dot_product(team, n, r, z);
  const double enough = (problem.tolerance * problem.tolerance) * energy;
  GradientOutcome outcome;
  outcome.is_met = !(energy > enough);
  while (!outcome.is_met && outcome.iterations < problem.most) {
    A.apply(team, p, q);
    const double curvature = dot_product(team, n, p, q);
    if (!(curvature > 0.0)) break;
    const double alpha = div_(energy, curvature);
    for_each(team, n, [&](Index i) {
      x[i] = fma_(alpha, p[i], x[i]);
      r[i] = fma_(0.0 - alpha, q[i], r[i]);
    });
    preconditioner.apply(team, r, z);
    const double next = dot_product(team, n, r, z);
    const double beta = div_(next, energy);
    energy = next;
    ++outcome.iterations;
    outcome.is_met = !(energy > enough);
    for_each(team, n, [&](Index i) { p[i] = fma_(beta, p[i], z[i]); });
  }
  return outcome;
}

}  // namespace stiction::inline STICTION_ISA
