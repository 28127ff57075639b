#pragma once

#include "core/algorithm/sweep/local_solve.hpp"
#include "core/algorithm/sweep/symmetric_eigen.hpp"

/// Projections onto the positive semidefinite matrices of order 2 and 3 (docs/math/semidefinite.md). A matrix is its
/// upper triangle, column by column, off-diagonals times sqrt(2). The inner product of rows is thus that of matrices.
namespace stiction::inline STICTION_ISA {

/// Factor of a matrix with that largest entry before squares are taken: a power of two.
template <class Real>
STICTION_HD Real matrix_unit(Real largest) {
  constexpr bool kIsFloat = sizeof(Real) == sizeof(float);
  const Real scale = unit_scale(largest);
  if (scale != Real(1)) return scale;
  // unit_scale() leaves numbers alone that its reciprocal could not undo.
  if (largest >= Real(2)) return static_cast<Real>(kIsFloat ? 0x1p-100 : 0x1p-600);
  return largest < Real(1) ? static_cast<Real>(kIsFloat ? 0x1p100 : 0x1p600) : Real(1);
}

/// Order 2: (a_11, sqrt(2) a_12, a_22) of numbers near 1. The eigenvalues are mean +- radius. The one that is left is a
/// quotient where that sum cancels. Radius less gap is, too, of which the smaller diagonal entry is a share.
template <class Real>
STICTION_HD void project_unit_matrix(Real (&z)[3]) {
  const Real mean = Real(0.5) * z[0] + Real(0.5) * z[2];
  const Real gap = Real(0.5) * z[0] - Real(0.5) * z[2];
  const Real coupling = Real(0.5) * z[1];
  // Minus the determinant, a_12^2 - a_11 a_22, the product's own rounding taken off (Kahan).
  const Real product = z[0] * z[2];
  const Real rounding = fma_(z[0], z[2], Real(0) - product);
  const Real fall = fma_(coupling, z[1], Real(0) - product) - rounding;
  if (fall <= Real(0)) {
    const Real kept = select(mean > Real(0), Real(1), Real(0));
    for (int k = 0; k < 3; ++k) z[k] = kept * z[k];
    return;
  }
  const Real radius = sqrt_(fma_(coupling, z[1], gap * gap));
  const Real largest = mean < Real(0) ? div_(fall, radius - mean) : mean + radius;
  const Real share = div_(Real(0.5) * largest, radius);
  const Real larger = radius + abs_(gap);
  const Real smaller = div_(coupling * z[1], larger);
  z[0] = share * (gap < Real(0) ? smaller : larger);
  z[2] = share * (gap < Real(0) ? larger : smaller);
  z[1] = share * z[1];
}

/// Order 3: (a_11, sqrt(2) a_12, a_22, sqrt(2) a_13, sqrt(2) a_23, a_33) of numbers near 1. The part of positive
/// eigenvalues is the remainder.
template <class Real>
STICTION_HD void project_unit_matrix(Real (&z)[6]) {
  constexpr int kOrder = 3;
  const auto inverse_root = static_cast<Real>(0.70710678118654752440);
  const auto root = static_cast<Real>(1.41421356237309504880);
  Real S[kOrder][kOrder];
  Real V[kOrder][kOrder];
  Real e[kOrder];
  for (int j = 0, k = 0; j < kOrder; ++j)
    for (int i = 0; i <= j; ++i, ++k) S[i][j] = S[j][i] = i == j ? z[k] : inverse_root * z[k];
  symmetric_eigen<kOrder, true>(S, V, e);
  const bool is_inside = e[0] >= Real(0) && e[1] >= Real(0) && e[2] >= Real(0);
  if (is_inside) return;
  for (int j = 0, k = 0; j < kOrder; ++j)
    for (int i = 0; i <= j; ++i, ++k) {
      Real sum(0);
      for (int l = 0; l < kOrder; ++l) {
        const Real kept = select(e[l] > Real(0), e[l], Real(0));
        sum = fma_(kept * V[i][l], V[j][l], sum);
      }
      z[k] = i == j ? sum : root * sum;
    }
}

/// z becomes the nearest positive semidefinite matrix of M = 3 or 6 rows. One that is not of finite numbers becomes one
/// of none. A function everywhere: cones of this kind are rare, and it is long.
template <class Real, int M>
STICTION_HD_SHARED void project_semidefinite(Real (&z)[M]) {
  Real largest(0);
  Real nothing(0);
  for (int k = 0; k < M; ++k) {
    largest = max_(abs_(z[k]), largest);
    nothing = nothing + (z[k] - z[k]);
  }
  if (nothing != Real(0)) {
    for (int k = 0; k < M; ++k) z[k] = nothing;
    return;
  }
  if (largest == Real(0)) return;
  const Real scale = matrix_unit(largest);
  const Real inverse = div_(Real(1), scale);
  Real unit[M];
  for (int k = 0; k < M; ++k) unit[k] = scale * z[k];
  project_unit_matrix(unit);
  for (int k = 0; k < M; ++k) z[k] = inverse * unit[k];
}

/// True if a method can treat semidefinite cones: one that projects.
template <class Method>
inline constexpr bool kTakesSemidefinite = requires { requires Method::kProjectsMatrices; };

/// True if a form of system can have such cones: those in the batch's order, which is where choose_path() sends them.
template <class System>
inline constexpr bool kMayHaveSemidefinite = requires(const System& s) { s.env->kind; };

/// True if cones of a shape can be matrices.
template <class Shape>
inline constexpr bool kMayBeMatrix = Shape::kKind == ConeKind::friction && (Shape::kRows == 3 || Shape::kRows == 6);

/// Returns true if a cone of a system is semidefinite.
template <class Shape, class System>
STICTION_HD bool is_semidefinite(Shape, const System& s, Index cone) {
  if constexpr (kMayBeMatrix<Shape> && kMayHaveSemidefinite<System>) {
    return s.env->kind[cone] == ConeKind::semidefinite;
  } else {
    return false;
  }
}

/// proximal_point() of a cone of a system, semidefinite ones included. Semidefinite cones have no law of friction.
template <Law kLaw, class Shape, class System, class Real, int M>
STICTION_HD void cone_proximal_point(Shape shape, const System& s, Index cone, Real (&z)[M], const Real (&y)[M],
                                     Real gain, Real lo, Real hi) {
  if constexpr (kMayBeMatrix<Shape> && kMayHaveSemidefinite<System>) {
    if (is_semidefinite(shape, s, cone)) {
      for (int k = 0; k < M; ++k) z[k] = fma_(Real(0) - gain, y[k], z[k]);
      project_semidefinite(z);
      return;
    }
  }
  proximal_point(shape, z, y, gain, lo, hi, law_of<kLaw>(s));
}

}  // namespace stiction::inline STICTION_ISA
