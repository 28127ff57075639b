#pragma once

#include "core/algorithm/solver/ipm/ipm_gradients.hpp"

/// The linear algebra of an interior point's step. One matrix is factored once and solved for predictor and corrector.
/// If there is no room for it, conjugate gradients solve the same system.
namespace stiction::inline STICTION_ISA {

/// A fixed row's place on the diagonal of K: no step.
inline constexpr double kHeldRow = 0x1p+512;
/// Term added to the diagonal of K, relative to A's. Directions of which neither A nor a barrier knows anything any
/// more are hence left alone instead of following roundings.
inline constexpr double kRegularisation = 0x1p-46;

/// Entry k of D at a cone's first row: W^-2 in the frame, or both bounds' multiplier over slack.
template <class Shape>
STICTION_HD double barrier_diagonal(Shape, const IpmSpace& p, Index row, int k) {
  if constexpr (Shape::kKind == ConeKind::friction) {
    return p.template scaling<Shape::kRows>(row).diagonal(k);
  } else {
    return div_(p.z[row], p.slack[row]) + div_(p.upper_z[row], p.upper_slack[row]);
  }
}

/// The cones' scalings at the current point.
template <Team TeamT, class System>
STICTION_HD_OUTLINE void scale_cones(TeamT& team, const System& s, const IpmSpace& p) {
  s.for_each_cone(team, [&](auto shape, Index, Index row) {
    using Shape = decltype(shape);
    if constexpr (Shape::kKind == ConeKind::friction) {
      double x[Shape::kRows];
      double z[Shape::kRows];
      load(p.x, row, x);
      load(p.z, row, z);
      const ConeScaling<Shape::kRows> scaling = scale_cone<Shape::kRows>(x, z);
      store(scaling.lambda, p.lambda, row);
      store(scaling.inverse_eigenvalues, p.inverse_eigenvalues, row);
      store(scaling.householder, p.householder, row);
    }
  });
}

/// D, for conjugate gradients.
template <Team TeamT, class System>
STICTION_HD_OUTLINE void fill_diagonal(TeamT& team, const System& s, const IpmSpace& p) {
  s.for_each_cone(team, [&](auto shape, Index cone, Index row) {
    using Shape = decltype(shape);
    bool is_held = false;
    if constexpr (Shape::kKind != ConeKind::friction) is_held = row_bounds(shape, s, cone).is_fixed();
    for (int k = 0; k < Shape::kRows; ++k)
      p.diagonal[row + k] = is_held ? kHeldRow : barrier_diagonal(shape, p, row, k);
  });
}

/// K = Q' (A + diag R) Q + D, factored; its cones' blocks are where it has no room.
template <Team TeamT, class System>
STICTION_HD_OUTLINE void factor_step(TeamT& team, const System& s, const IpmSpace& p) {
  if constexpr (kMultipliesWide<System>)
    if (!p.has_matrices) {
      fill_diagonal(team, s, p);
      prepare_gradients(team, s, p);
      return;
    }
  s.for_each_cone(team, [&](auto shape, Index, Index row) {
    using Shape = decltype(shape);
    for (Index i = 0; i < p.n; ++i) {
      double entry[Shape::kRows];
      for (int k = 0; k < Shape::kRows; ++k) entry[k] = 0.5 * (p.A(i, row + k) + p.A(row + k, i));
      if constexpr (Shape::kKind == ConeKind::friction) p.template scaling<Shape::kRows>(row).to_frame(entry);
      for (int k = 0; k < Shape::kRows; ++k) p.K(i, row + k) = entry[k];
    }
  });
  s.for_each_cone(team, [&](auto shape, Index cone, Index row) {
    using Shape = decltype(shape);
    if constexpr (Shape::kKind == ConeKind::friction) {
      const ConeScaling<Shape::kRows> scaling = p.template scaling<Shape::kRows>(row);
      for (Index j = 0; j < p.n; ++j) {
        double entry[Shape::kRows];
        for (int k = 0; k < Shape::kRows; ++k) entry[k] = p.K(row + k, j);
        scaling.to_frame(entry);
        for (int k = 0; k < Shape::kRows; ++k) p.K(row + k, j) = entry[k];
      }
    }
    for (int k = 0; k < Shape::kRows; ++k) {
      double& entry = p.K(row + k, row + k);
      entry = entry + (abs_(entry) * kRegularisation + barrier_diagonal(shape, p, row, k));
      if constexpr (Shape::kKind != ConeKind::friction)
        if (row_bounds(shape, s, cone).is_fixed()) entry = kHeldRow;
    }
  });
  factor_ldl(team, p.K, 0.0);
}

/// step = K^-1 force, refined: the parts of the regularisation and of an asymmetric A come back. Conjugate gradients
/// stop at `accuracy`.
template <Team TeamT, class System>
STICTION_HD_OUTLINE void solve_step(TeamT& team, const System& s, const IpmSpace& p, double accuracy) {
  if constexpr (kMultipliesWide<System>)
    if (!p.has_matrices) {
      solve_by_gradients(team, s, p, accuracy);
      return;
    }
  constexpr int kRefinements = 2;
  for_each(team, p.n, [&](Index i) { p.step[i] = p.force[i]; });
  solve_ldl(team, p.K, p.step);
  for (int pass = 0; pass < kRefinements; ++pass) {
    s.for_each_cone(team, [&](auto shape, Index, Index row) {
      using Shape = decltype(shape);
      double v[Shape::kRows];
      load(p.step, row, v);
      if constexpr (Shape::kKind == ConeKind::friction) p.template scaling<Shape::kRows>(row).from_frame(v);
      store(v, p.work, row);
    });
    multiply_wide(team, s, p, p.work, [&](Index i, double value) { p.dual_step[i] = value; });
    s.for_each_cone(team, [&](auto shape, Index cone, Index row) {
      using Shape = decltype(shape);
      double v[Shape::kRows];
      load(p.dual_step, row, v);
      if constexpr (Shape::kKind == ConeKind::friction) p.template scaling<Shape::kRows>(row).to_frame(v);
      for (int k = 0; k < Shape::kRows; ++k)
        v[k] = (p.force[row + k] - v[k]) - barrier_diagonal(shape, p, row, k) * p.step[row + k];
      if constexpr (Shape::kKind != ConeKind::friction)
        if (row_bounds(shape, s, cone).is_fixed()) v[0] = 0.0;
      store(v, p.work, row);
    });
    solve_ldl(team, p.K, p.work);
    for_each(team, p.n, [&](Index i) { p.step[i] = p.step[i] + p.work[i]; });
  }
}

}  // namespace stiction::inline STICTION_ISA
