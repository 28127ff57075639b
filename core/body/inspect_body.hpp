#pragma once

#include "core/block/reduce.hpp"
#include "core/body/env_view.hpp"

namespace stiction::inline STICTION_ISA {

/// What one look at an environment's numbers tells.
template <class Real>
struct Inspection {
  std::uint32_t flags;     ///< EnvFlag bits; anything but kFlagWarmStartRejected makes the input invalid
  Real largest_b;          ///< max|b| [w]
  Real largest_diagonal;   ///< max of diag(A) + R [w / lambda]
};

/// Diagonal entry of A + diag R; duplicates add up.
template <class Real>
STICTION_HD Real diagonal_entry(const EnvView<Real>& env, Index row) {
  Real sum = env.R[row];
  for (Offset k = env.row_offsets[row]; k < env.row_offsets[row + 1]; ++k)
    if (env.column[k] == row) sum = sum + env.A[k];
  return sum;
}

/// Finiteness and signs, before anything is projected: a projection would turn NaN into zero.
template <Block B, class Real>
STICTION_HD Inspection<Real> inspect(B& block, const EnvView<Real>& env) {
  std::uint32_t flags = 0;
  Real largest_b(0);
  Real largest_diagonal(0);
  for (Index cone = block.rank(); cone < env.cone_count; cone += block.size()) {
    const ConeKind kind = env.kind[cone];
    const Index first = env.cone_row(cone);
    const Index size = env.cone_size(cone);
    for (Index i = first; i < first + size; ++i) {
      bool finite = finite_(env.b[i]) && finite_(env.R[i]);
      for (Offset k = env.row_offsets[i]; k < env.row_offsets[i + 1]; ++k) finite = finite && finite_(env.A[k]);
      if (kind == ConeKind::friction && i > first) {
        finite = finite && finite_(env.mu[i]);
        if (env.mu[i] < Real(0)) flags |= kFlagNegativeFriction;
      }
      if (kind == ConeKind::box) {
        finite = finite && env.lo[i] == env.lo[i] && env.hi[i] == env.hi[i];
        if (env.lo[i] > env.hi[i]) flags |= kFlagCrossedBounds;
      }
      if (!finite) flags |= kFlagNonFiniteInput;
      if (env.R[i] < Real(0)) flags |= kFlagNegativeCompliance;
      const Real diagonal = diagonal_entry(env, i);
      // A tangential row that couples to nothing is solvable (it slides); a normal or single row is not.
      const bool bad = i == first ? !(diagonal > Real(0)) : diagonal < Real(0);
      if (bad && kind != ConeKind::free) flags |= kFlagBadDiagonal;
      largest_b = max_(abs_(env.b[i]), largest_b);
      largest_diagonal = max_(abs_(diagonal), largest_diagonal);
    }
  }
  if (env.warm_start != nullptr)
    for (Index i = block.rank(); i < env.n; i += block.size())
      if (!finite_(env.warm_start[i])) flags |= kFlagWarmStartRejected;
  return {block.combine(flags), block.max(largest_b), block.max(largest_diagonal)};
}

}  // namespace stiction::inline STICTION_ISA
