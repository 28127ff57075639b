#pragma once

#include "core/algorithm/solver/admm/penalized_gradients.hpp"
#include "core/algorithm/solver/admm/penalized_velocity.hpp"

/// K + rho in the form that suits the environment.
namespace stiction::inline STICTION_ISA {

/// Computes the parts that do not depend on rho. Returns the largest difference between two halves of A.
template <Team TeamT, class System>
STICTION_HD double fill_scaled(TeamT& team, const System& s, const AdmmState& a) {
  if (a.form == AdmmForm::matrix) return fill_scaled_matrix(team, s, a);
  return 0.0;
}

template <Team TeamT, class System>
STICTION_HD void factor_penalized(TeamT& team, const System& s, const AdmmState& a, double rho) {
  if constexpr (kHasVelocity<System>)
    if (a.form == AdmmForm::velocity) {
      factor_velocity(team, s, a, rho);
      return;
    }
  if constexpr (kMultipliesWide<System>)
    if (a.form == AdmmForm::gradients) {
      prepare_penalized_gradients(team, s, a, rho);
      return;
    }
  factor_matrix(team, s, a, rho);
}

/// v = (K + rho)^-1 v. Overwrites f.
template <Team TeamT, class System>
STICTION_HD void solve_penalized(TeamT& team, const System& s, const AdmmState& a, double rho) {
  if constexpr (kHasVelocity<System>)
    if (a.form == AdmmForm::velocity) {
      solve_velocity(team, s, a);
      return;
    }
  if constexpr (kMultipliesWide<System>)
    if (a.form == AdmmForm::gradients) {
      solve_penalized_gradients(team, s, a, rho);
      return;
    }
  solve_ldl(team, a.factor, a.v);
}

/// f = K v times a number, before K is factored.
template <Team TeamT, class System>
STICTION_HD_OUTLINE void multiply_scaled(TeamT& team, const System& s, const AdmmState& a, double factor) {
  if constexpr (kMultipliesWide<System>)
    if (a.form != AdmmForm::matrix) {
      for_each(team, a.n, [&](Index i) { a.scaled[i] = a.scale[i] * a.v[i]; });
      prepare_wide_product(team, s, a.scaled);
      for_each(team, a.n, [&](Index i) { a.f[i] = (a.scale[i] * wide_row(s, i, a.scaled)) * factor; });
      return;
    }
  const DenseMatrix& K = a.factor;
  for_each(team, a.n, [&](Index i) {
    double sum = 0.0;
    for (Index j = 0; j < a.n; ++j) sum = fma_(K(j, i), a.v[j], sum);
    a.f[i] = sum * factor;
  });
}

/// The largest eigenvalue of K, from below: a few steps of the power method from a start that is the same for all.
template <Team TeamT, class System>
STICTION_HD_OUTLINE double largest_eigenvalue(TeamT& team, const System& s, const AdmmState& a) {
  constexpr int kSteps = 8;
  const auto length = [&](const double* v) {
    return sqrt_(sum_leaves<double>(team, [&](Index leaf) {
      double sum = 0.0;
      for (Index i = leaf; i < a.n; i += kReduceLeaves) sum = fma_(v[i], v[i], sum);
      return sum;
    }));
  };
  for_each(team, a.n, [&](Index i) { a.v[i] = 1.0 + 0.125 * static_cast<double>((i * 5) % 7); });
  double largest = 0.0;
  double known = length(a.v);
  for (int step = 0; step < kSteps; ++step) {
    multiply_scaled(team, s, a, known > 0.0 ? div_(1.0, known) : 0.0);
    for_each(team, a.n, [&](Index i) { a.v[i] = a.f[i]; });
    known = length(a.v);
    largest = max_(known, largest);
  }
  return largest > 0.0 ? largest : 1.0;
}

}  // namespace stiction::inline STICTION_ISA
