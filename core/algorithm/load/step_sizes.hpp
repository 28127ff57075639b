#pragma once

#include "core/algorithm/residual/residual_estimate.hpp"

/// Step sizes of a cone from its rows of A: bounds of eigenvalues, and the metric of a convex sweep.
namespace stiction::inline STICTION_ISA {

/// An upper bound on the largest eigenvalue of the symmetric part of rows and columns [kFirst, M) of a cone's block.
/// It is at most M^(1/16) too large: trace(B^16)^(1/16), by four squarings of B / trace(B).
template <int M, int kFirst, class System>
STICTION_HD auto largest_eigenvalue_bound(const System& s, Index row) {
  using Real = typename System::Real;
  Real trace(0);
  for (int i = kFirst; i < M; ++i) trace = trace + s.block_entry(row, i, i);
  const auto positive = trace > Real(0);
  if (!any(positive)) return Real(0);
  // The powers of a symmetric matrix are symmetric: the upper triangle is enough.
  const Real inverse = div_(Real(0.5), trace);
  Real power[M][M];
  for (int i = kFirst; i < M; ++i)
    for (int j = i; j < M; ++j)
      power[i][j] = power[j][i] = (s.block_entry(row, i, j) + s.block_entry(row, j, i)) * inverse;
  for (int squaring = 0; squaring < 4; ++squaring) {
    Real square[M][M];
    for (int i = kFirst; i < M; ++i)
      for (int j = i; j < M; ++j) {
        Real sum = power[i][kFirst] * power[kFirst][j];
        for (int k = kFirst + 1; k < M; ++k) sum = fma_(power[i][k], power[k][j], sum);
        square[i][j] = square[j][i] = sum;
      }
    for (int i = kFirst; i < M; ++i)
      for (int j = kFirst; j < M; ++j) power[i][j] = square[i][j];
  }
  Real sum(0);
  for (int i = kFirst; i < M; ++i) sum = sum + power[i][i];
  return select(positive, trace * sqrt_(sqrt_(sqrt_(sqrt_(sum)))), Real(0));
}

/// Smallest tangential step bound relative to the whole block's.
inline constexpr float kSmallestTangential = 1.0F / (1 << 30);

/// Factors that an environment's numbers are multiplied by.
template <class Real>
struct LoadScales {
  Real a;  ///< A, a power of two
  Real b;  ///< b, a power of two
  Real x;  ///< reactions: b / a
};
template <class Real, int kStride>
STICTION_HD LoadScales<Real> load_scales(const SystemArrays<Real, kStride>& s) {
  return {s.scalar[kScaleA], s.scalar[kScaleB], div_(s.scalar[kScaleB], s.scalar[kScaleA])};
}

/// 1 / value where that is positive, else 0.
template <class Real>
STICTION_HD Real inverse_of_positive(Real value) {
  return select(value > Real(0), div_(Real(1), value), Real(0));
}

/// The metric in which a convex sweep steps is diag(B_nn, tau, tau, ...) / damping, which is nowhere below the cone's
/// block B (docs/math/local_solve.md). This is the part of it beyond inv_n and inv_t.
template <class Real>
struct BlockMetric {
  Real damping;  ///< 1 / (1 + rho), where rho <= 1 is how strongly normal and tangential rows are coupled
  Real share;    ///< tau / (B_nn + tau)
};
template <int M, class System>
STICTION_HD auto block_metric(const System& s, Index row, typename System::Real inv_n, typename System::Real inv_t) {
  using Real = typename System::Real;
  Real coupling(0);
  for (int k = 1; k < M; ++k) {
    const Real entry = Real(0.5) * (s.block_entry(row, 0, k) + s.block_entry(row, k, 0));
    coupling = fma_(entry, entry, coupling);
  }
  const Real rho = sqrt_((coupling * inv_n) * inv_t);
  const Real sum = inv_n + inv_t;
  return BlockMetric<Real>{div_(Real(1), Real(1) + rho), select(sum > Real(0), div_(inv_n, sum), Real(0))};
}

/// Error of a cone that has no reaction, at least kIdleShare of its largest |b|: a part of its island's scale. `y` is
/// b in the coordinates of the unit cone, `largest` that |b|. `is_matrix`: it is one of semidefinite.
template <class Shape, class Real, int M>
STICTION_HD Real error_without_reaction(Shape shape, const Real (&y)[M], const ConeMetric<Real, M>& metric, Real lo,
                                        Real hi, Law law, bool is_matrix, Real largest) {
  Real none[M];
  for (int k = 0; k < M; ++k) none[k] = Real(0);
  Real square;
  // Packs have no cones of semidefinite.
  if constexpr (kMayBeMatrix<Shape> && RealTraits<Real>::kLanes == 1)
    if (is_matrix) return max_(sqrt_(semidefinite_error_square(none, y, Real(0))), Real(kIdleShare) * largest);
  if (law == Law::coulomb) {
    square = law_error_square<Law::coulomb>(shape, none, y, metric, lo, hi);
  } else {
    square = law_error_square<Law::convex>(shape, none, y, metric, lo, hi);
  }
  // A scale that is no number would be no scale at all.
  return max_(select(finite_(square), sqrt_(square), Real(0)), Real(kIdleShare) * largest);
}

/// Works in the lanes of `due`. It turns load_row()'s numbers into the solver's units. It takes step lengths from the
/// cone's rows of A, which are in place and scaled. It moves the guess into the cone. residual_weight holds the sum of
/// the cone's diagonal.
template <class Shape, class System>
STICTION_HD void finish_cone(Shape shape, System& s, Index cone, Index row,
                             const LoadScales<typename System::Real>& scales, Mask<typename System::Real> due, Law law,
                             bool is_matrix) {
  using Real = typename System::Real;
  constexpr int kRows = Shape::kRows;
  const auto put = [due](Real& to, Real value) { to = select(due, value, to); };
  // A slot without a cone weighs nothing, as all of it is zero.
  const Real mean = kRows == 1 ? s.residual_weight[cone] : div_(s.residual_weight[cone], Real(kRows));
  put(s.residual_weight[cone], select(s.inv_cone[cone] > Real(0), residual_weight(mean * scales.a), Real(0)));
  const Real inv_n = inverse_of_positive(s.block_entry(row, 0, 0));
  put(s.inv_n[cone], inv_n);
  if constexpr (kRows == 1) {
    put(s.inv_t[cone], Real(0));
    put(s.inv_cone[cone], inv_n);
    put(s.damping[cone], Real(1));
    put(s.share[cone], Real(0));
  } else {
    // A tangential block that couples to nothing still needs a finite step: its rows slide to the disk's edge.
    const Real whole = largest_eigenvalue_bound<kRows, 0>(s, row);
    const Real tangential = largest_eigenvalue_bound<kRows, 1>(s, row);
    const Real inv_t = inverse_of_positive(max_(tangential, whole * Real(kSmallestTangential)));
    const BlockMetric<Real> metric = block_metric<kRows>(s, row, inv_n, inv_t);
    put(s.inv_t[cone], inv_t);
    put(s.inv_cone[cone], inverse_of_positive(whole));
    put(s.damping[cone], metric.damping);
    put(s.share[cone], metric.share);
  }
  if constexpr (Shape::kKind == ConeKind::box) {
    put(s.lo[cone], s.lo[cone] * scales.x);
    put(s.hi[cone], s.hi[cone] * scales.x);
  }
  Real z[kRows];
  Real still[kRows];
  Real y[kRows];
  ConeMetric<Real, kRows> metric;
  metric.a = max_(s.block_entry(row, 0, 0), Real(0));
  Real largest(0);
  for (int k = 0; k < kRows; ++k) {
    const Real scale = s.best[row + k];
    const Real b = s.b[row + k] * scales.b;
    largest = max_(abs_(b), largest);
    y[k] = b * scale;
    put(s.b[row + k], y[k]);
    const auto weights = unit_axis_weights(metric.a, s.block_entry(row, k, k), scale);
    metric.press[k] = weights.press;
    metric.slip[k] = weights.slip;
    put(s.axis_press[row + k], weights.press);
    put(s.axis_slip[row + k], weights.slip);
    z[k] = select(scale > Real(0), div_(s.x[row + k] * scales.x, scale), Real(0));
    still[k] = Real(0);
  }
  put(s.press[cone], metric.a);
  put(s.island[cone], error_without_reaction(shape, y, metric, s.lo[cone], s.hi[cone], law, is_matrix, largest));
  Real x[kRows];
  for (int k = 0; k < kRows; ++k) x[k] = z[k];
  proximal_point(shape, x, still, Real(0), s.lo[cone], s.hi[cone], Law::convex);
  if constexpr (kRows > 1) {
    if (has_box_friction(s)) project_box_friction(x, z, s.lo[cone] < Real(0));
  }
  for (int k = 0; k < kRows; ++k) put(s.x[row + k], canonical_zero(x[k]));
}

}  // namespace stiction::inline STICTION_ISA
