#pragma once

#include "core/algorithm/linear/block/cone_blocks.hpp"
#include "core/algorithm/linear/block/wide_product.hpp"
#include "core/algorithm/linear/dense/dense_product.hpp"
#include "core/algorithm/linear/dense/fill_matrix.hpp"
#include "core/algorithm/linear/krylov/bicgstab.hpp"

namespace stiction::inline STICTION_ISA {

/// Vectors that both branches of Newton's method keep in doubles. The first vectors mean the same in both; the others
/// belong to one branch, of which an environment takes only one.
enum NewtonVector : Index {
  kCompliance = 0,  ///< R, in the solver's coordinates
  kPoint,           ///< zeta; proximal: x
  kMotion,          ///< u = A zeta + b; proximal: y = (A + R) x + b
  kGap,             ///< zeta - x(u); proximal: error of the natural map
  kStep,            ///< Newton's direction d
  kImage,           ///< A d; proximal: (A + R) d
  kConeSlope,       ///< by cone: terms of a sum over cones
  kConeCurvature,   ///< the same
  kContactStates,   ///< by cone: ConeZone at the last factorisation
  kUnknown,         ///< right-hand side and solution of the factored system
  kFactor,          ///< C, six columns: entry (k, j) of the cone at row r at 6 (r + k) + j
  kNewtonVectors = kFactor + 6,
  kProxCenter = kContactStates,  ///< proximal: the point that the proximal term pulls to
  kPivots = kFactor,             ///< proximal: exchanged rows
  kTrial = kFactor + 1,          ///< proximal: the point tried
  kTrialMotion = kFactor + 2,    ///< proximal: its motion
  // Instead of matrices.
  kDiagonal = kNewtonVectors,  ///< of A; proximal: of A + R
  kTurned,                     ///< primal: C times a vector; proximal: derivative of norm(y_t)
  kGuess,                      ///< primal: where the search for t begins
  kConeFactors,                ///< the cones' blocks of the step's matrix: factors; proximal: inverses
  kDerivative = kConeFactors + kConeBlockWorkspace,  ///< proximal: P', six columns
  kGradients = kDerivative + kConeBlockWorkspace,    ///< vectors of the method of gradients
  kNewtonEnd = kGradients + kStabilizedVectors,
};
static_assert(kGradientVectors <= kStabilizedVectors);

inline constexpr Index kNewtonMatrices = 2;
inline constexpr Index kNewtonMatrixFreeVectors = kNewtonEnd - kNewtonVectors;  ///< vectors, instead of the matrices

/// The vectors and matrices of one environment.
struct NewtonWorkspace {
  double* first;
  Index n;
  bool has_matrices;  ///< else steps are found by gradients

  [[nodiscard]] STICTION_HD double* vector(Index k) const { return first + Offset{k} * n; }
  [[nodiscard]] STICTION_HD DenseMatrix matrix(Index k) const {
    return {first + Offset{kNewtonVectors} * n + Offset{k} * n * n, n};
  }
  /// Entry i of the diagonal of A; proximal: of A + R.
  [[nodiscard]] STICTION_HD double diagonal(Index i) const {
    return has_matrices ? matrix(0)(i, i) : vector(kDiagonal)[i];
  }
};
template <class System>
STICTION_HD NewtonWorkspace newton_room(const System& s) {
  return {s.wide, s.n, s.has_matrices};
}

/// A cone's rows of a vector.
template <int M, class Vector>
STICTION_HD void read_cone(const Vector& from, Index row, double (&to)[M]) {
  for (int k = 0; k < M; ++k) to[k] = static_cast<double>(from[row + k]);
}

/// store(i, base(i) + row i of A times in); with kCompliance of A + R. Matrix 0, where it is there, is that one.
template <bool kCompliance, Team TeamT, class System, class Base, class Store>
STICTION_HD_OUTLINE void multiply_motion(TeamT& team, const System& s, const double* in, const Base& base,
                                         const Store& store) {
  const NewtonWorkspace workspace = newton_room(s);
  if constexpr (kMultipliesWide<System>)
    if (!workspace.has_matrices) {
      prepare_wide_product(team, s, in);
      for_each(team, s.n, [&](Index i) {
        const double start = kCompliance ? fma_(static_cast<double>(s.R[i]), in[i], base(i)) : base(i);
        store(i, wide_row(s, i, in, start));
      });
      return;
    }
  multiply_dense(team, workspace.matrix(0), in, base, store);
}

/// One vector's motion, b included, into another.
template <bool kCompliance, Team TeamT, class System>
STICTION_HD_OUTLINE void renew_motion(TeamT& team, const System& s, Index point, Index motion) {
  const NewtonWorkspace workspace = newton_room(s);
  double* const y = workspace.vector(motion);
  multiply_motion<kCompliance>(
      team, s, workspace.vector(point), [&](Index i) { return static_cast<double>(s.b[i]); },
      [&](Index i, double value) { y[i] = value; });
}

}  // namespace stiction::inline STICTION_ISA
