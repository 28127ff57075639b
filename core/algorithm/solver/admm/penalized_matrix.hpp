#pragma once

#include "core/algorithm/linear/dense/fill_matrix.hpp"
#include "core/algorithm/solver/admm/admm_state.hpp"

/// K + rho as a matrix of all rows, factored (docs/math/admm.md).
namespace stiction::inline STICTION_ISA {

inline constexpr double kFreeShare = 1e-4;  ///< rho of free rows, which nothing splits, over rho of the others

template <class Shape>
STICTION_HD double own_penalty(Shape, double rho) {
  return Shape::kKind == ConeKind::free ? kFreeShare * rho : rho;
}

/// K = scale (A + R) scale, symmetrised. Returns the largest difference that this took.
template <Team TeamT, class System>
STICTION_HD_OUTLINE double fill_scaled_matrix(TeamT& team, const System& s, const AdmmState& a) {
  const DenseMatrix& K = a.factor;
  fill_matrix(team, s, K);
  double difference = 0.0;
  for_each(team, a.n, [&](Index i) {
    for (Index j = 0; j <= i; ++j) {
      difference = max_(abs_(K(i, j) - K(j, i)), difference);
      K(i, j) = K(j, i) = (0.5 * K(i, j) + 0.5 * K(j, i)) * (a.scale[i] * a.scale[j]);
    }
  });
  return team.max(difference);
}

template <Team TeamT, class System>
STICTION_HD_OUTLINE void factor_matrix(TeamT& team, const System& s, const AdmmState& a, double rho) {
  constexpr double kFloor = 0x1p-48;
  s.for_each_cone(team, [&](auto shape, Index, Index row) {
    for (int k = 0; k < decltype(shape)::kRows; ++k)
      a.factor(row + k, row + k) = a.factor(row + k, row + k) + own_penalty(shape, rho);
  });
  factor_ldl(team, a.factor, kFloor * rho);
}

/// Computes the part of an asymmetric A that the factor lacks, from the motion that was recorded with x. It is the
/// motion less load, less K + rho as the factor has it, plus rho. Once in a chunk is often enough, since it is
/// small.
template <Team TeamT, class System>
STICTION_HD_OUTLINE void find_skew(TeamT& team, const System& s, const AdmmState& a, double rho) {
  const DenseMatrix& L = a.factor;
  for_each(team, a.n, [&](Index j) {
    double sum = a.z[j];
    for (Index i = j + 1; i < a.n; ++i) sum = fma_(L(i, j), a.z[i], sum);
    a.f[j] = sum * L(j, j);
  });
  s.for_each_cone(team, [&](auto shape, Index, Index row) {
    for (Index i = row; i < row + decltype(shape)::kRows; ++i) {
      double known = a.f[i];
      for (Index j = 0; j < i; ++j) known = fma_(L(j, i), a.f[j], known);
      const double motion = static_cast<double>(s.y[i]) - static_cast<double>(s.b[i]);
      a.skew[i] = fma_(own_penalty(shape, rho), a.z[i], fma_(motion, a.scale[i], 0.0 - known));
    }
  });
}

}  // namespace stiction::inline STICTION_ISA
