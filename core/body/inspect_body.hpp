#pragma once

#include "core/block/reduce.hpp"
#include "core/body/factor_system.hpp"
#include "core/body/place.hpp"

namespace stiction::inline STICTION_ISA {

/// Flags that an environment may carry and still be solved.
inline constexpr std::uint32_t kHarmlessFlags = kFlagWarmStartRejected | kFlagCapacity;

/// What one look at an environment's numbers tells.
template <class Real>
struct Inspection {
  std::uint32_t flags;    ///< EnvFlag bits; any but kHarmlessFlags makes the input invalid
  Real largest_b;         ///< max|b| [w]
  Real largest_diagonal;  ///< max of diag(A) + R [w / lambda]
};

/// Diagonal of A + diag R at one row (duplicates add up), and whether every number of the row's A, b and R is finite.
template <class Real>
struct RowScan {
  Real diagonal;
  bool finite;
};

/// The first loop has no branch on the data, so that it vectorises: this reads every entry of every environment, and on
/// small systems that costs as much as sweeps do.
template <class Real>
STICTION_HD RowScan<Real> scan_row(const EnvView<Real>& env, Index row) {
  const Offset begin = env.row_offsets[row];
  const Index count = env.entries(row);
  const Real* a = env.A + begin;
  unsigned broken = 0;
  for (Index k = 0; k < count; ++k) broken |= static_cast<unsigned>(!finite_(a[k]));
  Real diagonal = env.R[row];
  if (row < count && is_run(env, row)) {
    diagonal = diagonal + a[row];
  } else {
    const Index* column = env.columns(row);
    for (Index k = 0; k < count; ++k)
      if (column[k] == row) diagonal = diagonal + a[k];
  }
  return {diagonal, broken == 0 && finite_(env.b[row]) && finite_(env.R[row])};
}

template <class Real, class System>
STICTION_HD RowScan<Real> scan_row(const EnvView<Real>& env, const System&, Index row) {
  return scan_row(env, row);
}

/// The same of a row of Y.
template <class Real>
STICTION_HD RowScan<Real> scan_row(const EnvView<Real>& env, const FactorSystem<Real>&, Index row) {
  const Real* y = env.factor + static_cast<Offset>(row) * env.dofs;
  bool finite = finite_(env.b[row]) && finite_(env.R[row]);
  Real diagonal = env.R[row];
  for (Index k = 0; k < env.dofs; ++k) {
    finite = finite && finite_(y[k]);
    diagonal = fma_(y[k], y[k], diagonal);
  }
  return {diagonal, finite};
}

/// Finiteness and signs, before anything is projected: a projection would turn NaN into zero. Leaves the sum of each
/// cone's diagonal in the system's trace.
template <Block B, class Real, class System>
STICTION_HD Inspection<Real> inspect(B& block, const EnvView<Real>& env, System& s) {
  std::uint32_t flags = env.flags;
  Real largest_b(0);
  Real largest_diagonal(0);
  for_each_place(block, env, s, [&](Index cone, ConePlace place) {
    const ConeKind kind = env.kind[cone];
    const Index first = env.cone_row(cone);
    const Index size = env.cone_size(cone);
    Real sum(0);
    for (Index k = 0; k < size; ++k) {
      const Index i = env.row_of(first, size, k);
      const RowScan<Real> row = scan_row(env, s, i);
      bool finite = row.finite;
      if (kind == ConeKind::friction && k > 0) {
        finite = finite && finite_(env.friction(i));
        if (env.friction(i) < Real(0)) flags |= kFlagNegativeFriction;
      }
      if (kind == ConeKind::box) {
        finite = finite && env.lo[i] == env.lo[i] && env.hi[i] == env.hi[i];
        if (env.lo[i] > env.hi[i]) flags |= kFlagCrossedBounds;
      }
      if (!finite) flags |= kFlagNonFiniteInput;
      if (env.R[i] < Real(0)) flags |= kFlagNegativeCompliance;
      // A tangential row that couples to nothing is solvable (it slides); a normal or single row is not.
      const bool bad = k == 0 ? !(row.diagonal > Real(0)) : row.diagonal < Real(0);
      if (bad && kind != ConeKind::free) flags |= kFlagBadDiagonal;
      sum = sum + row.diagonal;
      largest_b = max_(abs_(env.b[i]), largest_b);
      largest_diagonal = max_(abs_(row.diagonal), largest_diagonal);
    }
    s.trace[place.cone] = sum;
  });
  if (env.warm_start != nullptr)
    for (Index i = block.rank(); i < env.n; i += block.size())
      if (!finite_(env.warm_start[i])) flags |= kFlagWarmStartRejected;
  return {block.combine(flags), block.max(largest_b), block.max(largest_diagonal)};
}

}  // namespace stiction::inline STICTION_ISA
