#pragma once

#include "core/algorithm/load/inspect.hpp"

/// Distance of a loaded matrix from symmetry.
namespace stiction::inline STICTION_ISA {

/// max|A - A'| / max|A| of n rows or columns that lie one after another.
template <Team TeamT, class Real, int kStride>
STICTION_HD Real asymmetry(TeamT& team, Strided<Real, kStride> A, Index n) {
  Real largest(0);
  Real difference(0);
  for (Index j = team.rank(); j < n; j += team.size()) {
    const Strided<Real, kStride> column = A.from(Offset{n} * j);
    for (Index i = 0; i < n; ++i) {
      largest = max_(abs_(column[i]), largest);
      difference = max_(abs_(column[i] - A[j + n * i]), difference);
    }
  }
  largest = team.max(largest);
  difference = team.max(difference);
  return largest > Real(0) ? div_(difference, largest) : Real(0);
}

/// Asymmetry of a dense system.
template <Team TeamT, class Real, int kStride>
STICTION_HD Real asymmetry(TeamT& team, const DenseSystem<Real, kStride>& s) {
  return asymmetry(team, s.A, s.n);
}

/// Asymmetry on a sparse pattern; an entry whose transpose is not stored counts in full. Duplicates are compared one by
/// one and may overstate the difference.
template <Team TeamT, class Real>
STICTION_HD Real asymmetry(TeamT& team, const SparseSystem<Real>& s) {
  const EnvView<Real>& env = *s.env;
  const Offset base = env.row_offsets[0];
  Real largest(0);
  Real difference(0);
  const auto value = [&](Index row, Index k) { return s.value.data[env.row_offsets[row] - base + k]; };
  for (Index i = team.rank(); i < s.n; i += team.size())
    for (Index k = 0; k < env.entries(i); ++k) {
      const Index j = env.columns(i)[k];
      Real mirrored(0);
      for (Index t = 0; t < env.entries(j); ++t)
        if (env.columns(j)[t] == i) mirrored = value(j, t);
      largest = max_(abs_(value(i, k)), largest);
      difference = max_(abs_(value(i, k) - mirrored), difference);
    }
  largest = team.max(largest);
  difference = team.max(difference);
  return largest > Real(0) ? div_(difference, largest) : Real(0);
}

/// Y Y' is symmetric.
template <Team TeamT, class Real>
STICTION_HD Real asymmetry(TeamT&, const FactorSystem<Real>&) {
  return Real(0);
}

/// Largest asymmetry of A for a method that minimises.
inline constexpr float kLargestAsymmetry = 1e-2F;

}  // namespace stiction::inline STICTION_ISA
