#pragma once

#include "core/algorithm/solver/admm/penalized_matrix.hpp"

/// K + rho = Z Z' + E with Z = scale Y of n rows and dofs columns, E diagonal. It is solved through a matrix of the
/// dofs by Woodbury's formula (docs/math/admm.md).
namespace stiction::inline STICTION_ISA {

/// E^-1, and the factor of I + Z' E^-1 Z. Every entry is summed over rows in order by one lane.
template <Team TeamT, class Real>
STICTION_HD_OUTLINE void factor_velocity(TeamT& team, const FactorSystem<Real>& s, const AdmmState& a, double rho) {
  s.for_each_cone(team, [&](auto shape, Index, Index row) {
    for (Index i = row; i < row + decltype(shape)::kRows; ++i) {
      const double compliance = static_cast<double>(s.R[i]) * (a.scale[i] * a.scale[i]);
      a.inverse[i] = div_(1.0, compliance + own_penalty(shape, rho));
      a.v[i] = a.inverse[i] * (a.scale[i] * a.scale[i]);
    }
  });
  for_each(team, s.dofs, [&](Index j) {
    double* const column = &a.factor(0, j);
    for (Index k = j; k < s.dofs; ++k) column[k] = k == j ? 1.0 : 0.0;
    for (Index i = 0; i < s.n; ++i) {
      const Real* const entry = s.row(i);
      const double weight = a.v[i] * static_cast<double>(entry[j]);
      for (Index k = j; k < s.dofs; ++k) column[k] = fma_(weight, static_cast<double>(entry[k]), column[k]);
    }
  });
  factor_ldl(team, a.factor, 0.0);
}

/// v = E^-1 (v - Z (I + Z' E^-1 Z)^-1 Z' E^-1 v). Overwrites f.
template <Team TeamT, class Real>
STICTION_HD_OUTLINE void solve_velocity(TeamT& team, const FactorSystem<Real>& s, const AdmmState& a) {
  for_each(team, a.n, [&](Index i) { a.f[i] = a.scale[i] * (a.inverse[i] * a.v[i]); });
  prepare_wide_product(team, s, a.f);
  solve_ldl(team, a.factor, s.exact);
  for_each(team, a.n,
           [&](Index i) { a.v[i] = a.inverse[i] * fma_(0.0 - a.scale[i], wide_row(s, i, a.f, 0.0), a.v[i]); });
}

}  // namespace stiction::inline STICTION_ISA
