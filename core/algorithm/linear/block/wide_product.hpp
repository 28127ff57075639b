#pragma once

#include "core/algorithm/system/factor_system.hpp"
#include "core/algorithm/system/sparse_system.hpp"

/// Rows of A + diag R times a vector of doubles, without a matrix: for environments of any size.
namespace stiction::inline STICTION_ISA {

/// True if a system has such rows. A dense one is never too large for matrices.
template <class System>
inline constexpr bool kMultipliesWide = false;
template <class Real>
inline constexpr bool kMultipliesWide<SparseSystem<Real>> = true;
template <class Real>
inline constexpr bool kMultipliesWide<FactorSystem<Real>> = true;

/// True if its A is kept as Y Y'.
template <class System>
inline constexpr bool kHasVelocity = false;
template <class Real>
inline constexpr bool kHasVelocity<FactorSystem<Real>> = true;

/// Computes the product's common part of all rows: nothing, or the velocity Y' v.
template <Team TeamT, class Real>
STICTION_HD void prepare_wide_product(TeamT&, const SparseSystem<Real>&, const double*) {}
template <Team TeamT, class Real>
STICTION_HD_OUTLINE void prepare_wide_product(TeamT& team, const FactorSystem<Real>& s, const double* v) {
  constexpr Index kTile = TeamT::kRowTile;
  for_each(team, (s.dofs + kTile - 1) / kTile, [&](Index tile) {
    const Index first = tile * kTile;
    const Index count = first + kTile <= s.dofs ? kTile : s.dofs - first;
    double sum[kTile];
    for (Index t = 0; t < kTile; ++t) sum[t] = 0.0;
    for (Index i = 0; i < s.n; ++i) {
      const Real* const entry = s.row(i) + first;
      for (Index t = 0; t < count; ++t) sum[t] = fma_(static_cast<double>(entry[t]), v[i], sum[t]);
    }
    for (Index t = 0; t < count; ++t) s.exact[first + t] = sum[t];
  });
}

/// start + row i of A times v, for which the product was prepared.
template <class Real>
STICTION_HD_OUTLINE double wide_row(const SparseSystem<Real>& s, Index i, const double* v, double start) {
  return s.gather(i, v, start);
}
template <class Real>
STICTION_HD_OUTLINE double wide_row(const FactorSystem<Real>& s, Index i, const double*, double start) {
  const Real* const entry = s.row(i);
  double sum = start;
  for (Index k = 0; k < s.dofs; ++k) sum = fma_(static_cast<double>(entry[k]), s.exact[k], sum);
  return sum;
}

/// Row i of A + diag R times v.
template <class System>
STICTION_HD double wide_row(const System& s, Index i, const double* v) {
  return wide_row(s, i, v, static_cast<double>(s.R[i]) * v[i]);
}

}  // namespace stiction::inline STICTION_ISA
