#pragma once

#include "core/algorithm/solver/ipm/ipm_gradients.hpp"

/// The first point of an interior-point method: well inside the cones, centred, of the problem's size.
namespace stiction::inline STICTION_ISA {

/// Mean resistance of a cone's rows: the unit in which x and z of that cone compare.
template <int M, class System>
STICTION_HD double mean_diagonal(const System& s, const IpmSpace& p, Index row) {
  double sum = 0.0;
  for (int k = 0; k < M; ++k)
    sum = sum + (p.has_matrices ? p.A(row + k, row + k) : static_cast<double>(s.block_entry(row, k, k)));
  const double mean = div_(sum, static_cast<double>(M));
  return mean > 0.0 ? mean : 1.0;
}

/// A slack and its multiplier with slack * multiplier = gap, or an absent bound's.
STICTION_HD void start_bound(bool present, double workspace, double gap, double& slack, double& multiplier) {
  slack = present ? workspace : 1.0;
  multiplier = present ? div_(gap, workspace) : 0.0;
}

/// A row's first point: `wish`, pushed at least `margin` inside its bounds or to the middle between them.
STICTION_HD void start_row(const IpmSpace& p, Index row, const RowBounds& bounds, double wish, double margin,
                           double gap) {
  double lower = margin;
  double upper = margin;
  p.x[row] = wish;
  if (bounds.is_fixed()) {
    p.x[row] = bounds.lo;
  } else if (bounds.has_lo && bounds.has_hi) {
    const double width = bounds.hi - bounds.lo;
    const double inset = min_(margin, 0.5 * width);
    // Each distance for itself: of a far bound none is left of the other's digits.
    lower = clamp_(wish - bounds.lo, inset, width - inset);
    upper = clamp_(bounds.hi - wish, inset, width - inset);
    p.x[row] = lower < upper ? bounds.lo + lower : bounds.hi - upper;
  } else if (bounds.has_lo) {
    lower = max_(wish - bounds.lo, margin);
    p.x[row] = bounds.lo + lower;
  } else if (bounds.has_hi) {
    upper = max_(bounds.hi - wish, margin);
    p.x[row] = bounds.hi - upper;
  }
  start_bound(bounds.has_lo && !bounds.is_fixed(), lower, gap, p.slack[row], p.z[row]);
  start_bound(bounds.has_hi && !bounds.is_fixed(), upper, gap, p.upper_slack[row], p.upper_z[row]);
}

/// Start of a friction cone: moved up its axis, and z = gap times the inverse of x in the cone's algebra.
template <int M>
STICTION_HD_OUTLINE void start_cone(const IpmSpace& p, Index row, double (&wish)[M], double margin, double gap) {
  double sum = 0.0;
  for (int k = 1; k < M; ++k) sum = fma_(wish[k], wish[k], sum);
  wish[0] = max_(wish[0], sqrt_(sum)) + margin;
  const double determinant = cone_determinant<M>(wish);
  for (int k = 0; k < M; ++k) {
    p.x[row + k] = wish[k];
    p.z[row + k] = div_(gap * (k == 0 ? wish[k] : 0.0 - wish[k]), determinant);
  }
}

/// step = (A + diag force)^-1 step. Leaves p.force as it is.
template <Team TeamT, class System>
STICTION_HD_OUTLINE void solve_start(TeamT& team, const System& s, const IpmSpace& p) {
  if constexpr (kMultipliesWide<System>)
    if (!p.has_matrices) {
      start_by_gradients(team, s, p);
      return;
    }
  for_each(team, p.n * p.n, [&](Index k) {
    const Index i = k % p.n;
    const Index j = k / p.n;
    p.K.data[k] = 0.5 * (p.A(i, j) + p.A(j, i)) + (i == j ? p.force[i] : 0.0);
  });
  factor_ldl(team, p.K, 0.0);
  solve_ldl(team, p.K, p.step);
}

/// Fills the space and returns the number of barrier terms. The point is the minimiser of the problem without cones
/// but with each cone's own mean diagonal added, pushed inside. Its size gives all cones one complementarity.
template <Team TeamT, class System>
STICTION_HD_OUTLINE double start_interior(TeamT& team, System& s, const IpmSpace& p) {
  if (p.has_matrices) fill_matrix(team, s, p.A);
  s.for_each_cone(team, [&](auto shape, Index cone, Index row) {
    using Shape = decltype(shape);
    for (int k = 0; k < Shape::kRows; ++k) {
      const Index i = row + k;
      p.x[i] = p.z[i] = p.upper_z[i] = p.shift[i] = p.lambda[i] = p.inverse_eigenvalues[i] = p.householder[i] =
          p.affine[i] = 0.0;
      p.slack[i] = p.upper_slack[i] = 1.0;
      p.work[i] = k == 0 ? 1.0 : 0.0;
      p.force[i] = mean_diagonal<Shape::kRows>(s, p, row);
    }
    if constexpr (Shape::kKind != ConeKind::friction) {
      const RowBounds bounds = row_bounds(shape, s, cone);
      p.work[row] = (bounds.has_lo ? 1.0 : 0.0) + (bounds.has_hi ? 1.0 : 0.0);
      if (bounds.is_fixed()) p.work[row] = 0.0;
      if (bounds.has_lo) p.x[row] = max_(p.x[row], bounds.lo);
      if (bounds.has_hi) p.x[row] = min_(p.x[row], bounds.hi);
    }
  });
  const double terms = sum_values(team, p.work, p.n);
  multiply_wide(team, s, p, p.x, [&](Index i, double value) {
    p.motion[i] = value + static_cast<double>(s.b[i]);
    p.step[i] = 0.0 - p.motion[i];
  });
  solve_start(team, s, p);
  for_each(team, p.n, [&](Index i) { p.work[i] = 0.0 - p.step[i] * p.motion[i]; });
  const double energy = sum_values(team, p.work, p.n);
  const double gap = terms > 0.0 ? div_(energy, terms) : 0.0;
  // Without energy the point nearest to zero is the answer: the first iteration finds no complementarity and ends.
  if (gap > 0.0)
    s.for_each_cone(team, [&](auto shape, Index cone, Index row) {
      using Shape = decltype(shape);
      const double margin = sqrt_(div_(gap, p.force[row]));
      double wish[Shape::kRows];
      for (int k = 0; k < Shape::kRows; ++k) wish[k] = p.x[row + k] + p.step[row + k];
      if constexpr (Shape::kKind == ConeKind::friction) {
        start_cone<Shape::kRows>(p, row, wish, margin, gap);
      } else {
        start_row(p, row, row_bounds(shape, s, cone), wish[0], margin, gap);
      }
    });
  return terms;
}

}  // namespace stiction::inline STICTION_ISA
