#pragma once

#include "core/algorithm/linear/dense/dense_factor.hpp"
#include "core/algorithm/system/dense_system.hpp"
#include "core/algorithm/system/factor_system.hpp"
#include "core/algorithm/system/sparse_system.hpp"

/// Writes A + diag R of a loaded system as a dense matrix of doubles, in the solver's coordinates and the system's
/// order of rows. Methods that factorise work on it.
namespace stiction::inline STICTION_ISA {

template <Team TeamT, class Real>
STICTION_HD_OUTLINE void fill_matrix(TeamT& team, const DenseSystem<Real, 1>& s, const DenseMatrix& K) {
  for_each(team, s.n * s.n, [&](Index k) { K.data[k] = static_cast<double>(s.A[k]); });
}

/// Stored entries of one place add up in stored order.
template <Team TeamT, class Real>
STICTION_HD_OUTLINE void fill_matrix(TeamT& team, const SparseSystem<Real>& s, const DenseMatrix& K) {
  const EnvView<Real>& env = *s.env;
  for_each(team, s.n, [&](Index i) {
    for (Index j = 0; j < s.n; ++j) K(i, j) = 0.0;
    const Offset begin = env.row_offsets[i] - env.row_offsets[0];
    for (Index k = 0; k < env.entries(i); ++k) {
      double& entry = K(i, env.columns(i)[k]);
      entry = entry + static_cast<double>(s.value.data[begin + k]);
    }
    K(i, i) = K(i, i) + static_cast<double>(s.R[i]);
  });
}

template <Team TeamT, class Real>
STICTION_HD_OUTLINE void fill_matrix(TeamT& team, const FactorSystem<Real>& s, const DenseMatrix& K) {
  for_each(team, s.n, [&](Index i) {
    for (Index j = 0; j < s.n; ++j) {
      double sum = i == j ? static_cast<double>(s.R[i]) : 0.0;
      const Real* const left = s.row(i);
      const Real* const right = s.row(j);
      for (Index k = 0; k < s.dofs; ++k) sum = fma_(static_cast<double>(left[k]), static_cast<double>(right[k]), sum);
      K(i, j) = sum;
    }
  });
}

}  // namespace stiction::inline STICTION_ISA
