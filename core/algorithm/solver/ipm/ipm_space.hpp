#pragma once

#include "core/algorithm/linear/block/cone_blocks.hpp"
#include "core/algorithm/linear/block/wide_product.hpp"
#include "core/algorithm/linear/dense/fill_matrix.hpp"
#include "core/algorithm/linear/krylov/cg.hpp"
#include "core/algorithm/solver/ipm/cone_scaling.hpp"
#include "core/team/reduce.hpp"

namespace stiction::inline STICTION_ISA {

/// An interior point's doubles (docs/math/ipm.md). On rows of friction cones z is the dual and there is no slack.
/// Other rows have a slack and a multiplier for each finite bound, and a slack of one with a multiplier of zero for
/// the rest.
struct IpmSpace {
  enum Vector : Index {
    kPoint,
    kDual,
    kSlack,
    kUpperSlack,
    kUpperDual,
    kMotion,
    kShift,
    kStep,
    kDualStep,
    kUpperStep,
    kAffine,
    kLambda,
    kInverseEigenvalues,
    kHouseholder,
    kForce,
    kWork,
    kVectors
  };
  static constexpr Index kMatrices = 2;
  static constexpr Index kMatrixFreeVectors = kGradientVectors + kMaxConeRows + 1;  ///< vectors, instead of matrices

  Index n;
  bool has_matrices;            ///< else steps are found by conjugate gradients, and A and K are not there
  double* x;                    ///< primal point
  double* z;                    ///< cone: dual; row: multiplier of the lower bound
  double* slack;                ///< row: x - lo
  double* upper_slack;          ///< row: hi - x
  double* upper_z;              ///< row: multiplier of the upper bound
  double* motion;               ///< A x + b, de Saxce's shift included
  double* shift;                ///< that shift, on normal rows; zero elsewhere
  double* step;                 ///< solution of the linear system in the frames; then the step of x
  double* dual_step;            ///< step of z
  double* upper_step;           ///< step of upper_z
  double* affine;               ///< predictor: cone: scaled step; row: step. Then cone: lambda \ d
  double* lambda;               ///< cone: scaled point; row: target of slack z
  double* inverse_eigenvalues;  ///< cone: eigenvalues of W^-1; row: target of upper_slack upper_z
  double* householder;          ///< cone: reflection
  double* force;                ///< right-hand side in the frames
  double* work;                 ///< scratch
  DenseMatrix A;                ///< A + diag R
  DenseMatrix K;                ///< Q' (A + diag R) Q + D, then its factor
  double* diagonal;             ///< D
  double* cone_factor;          ///< of the cone's block of K, from 6 row on
  double* gradients;            ///< vectors of conjugate gradients

  template <class System>
  STICTION_HD explicit IpmSpace(const System& s) : n(s.n), has_matrices(s.has_matrices) {
    const auto take = [&](Vector k) { return s.wide_vector(k, s.n); };
    x = take(kPoint);
    z = take(kDual);
    slack = take(kSlack);
    upper_slack = take(kUpperSlack);
    upper_z = take(kUpperDual);
    motion = take(kMotion);
    shift = take(kShift);
    step = take(kStep);
    dual_step = take(kDualStep);
    upper_step = take(kUpperStep);
    affine = take(kAffine);
    lambda = take(kLambda);
    inverse_eigenvalues = take(kInverseEigenvalues);
    householder = take(kHouseholder);
    force = take(kForce);
    work = take(kWork);
    double* const rest = take(kVectors);
    A = DenseMatrix{has_matrices ? rest : nullptr, n};
    K = DenseMatrix{has_matrices ? rest + static_cast<Offset>(n) * n : nullptr, n};
    diagonal = has_matrices ? nullptr : rest;
    cone_factor = has_matrices ? nullptr : rest + n;
    gradients = has_matrices ? nullptr : rest + static_cast<Offset>(kMaxConeRows + 1) * n;
  }

  template <int M>
  STICTION_HD ConeScaling<M> scaling(Index row) const {
    ConeScaling<M> result;
    for (int k = 0; k < M; ++k) {
      result.inverse_eigenvalues[k] = inverse_eigenvalues[row + k];
      result.householder[k] = householder[row + k];
      result.lambda[k] = lambda[row + k];
    }
    return result;
  }
};

/// Bounds of a row outside friction cones.
struct RowBounds {
  double lo, hi;
  bool has_lo, has_hi;
  STICTION_HD bool is_fixed() const { return has_lo && has_hi && !(lo < hi); }
};

template <class Shape, class System>
STICTION_HD RowBounds row_bounds(Shape, const System& s, Index cone) {
  if constexpr (Shape::kKind == ConeKind::free) {
    return {0.0, 0.0, false, false};
  } else if constexpr (Shape::kKind == ConeKind::unilateral) {
    return {0.0, 0.0, true, false};
  } else {
    constexpr double kFar = 0x1p+500;
    const auto lo = static_cast<double>(s.lo[cone]);
    const auto hi = static_cast<double>(s.hi[cone]);
    return {lo, hi, lo > 0.0 - kFar, hi < kFar};
  }
}

/// store(i, row i of A + diag R times v), each row summed over columns from the left.
template <Team TeamT, class System, class Store>
STICTION_HD_OUTLINE void multiply_wide(TeamT& team, const System& s, const IpmSpace& p, const double* v,
                                       Store&& store) {
  if constexpr (kMultipliesWide<System>)
    if (!p.has_matrices) {
      prepare_wide_product(team, s, v);
      for_each(team, p.n, [&](Index i) { store(i, wide_row(s, i, v)); });
      return;
    }
  const DenseMatrix& A = p.A;
  constexpr Index kTile = TeamT::kRowTile;
  for_each(team, (A.n + kTile - 1) / kTile, [&](Index tile) {
    const Index first = tile * kTile;
    const Index rows = first + kTile <= A.n ? kTile : A.n - first;
    double sum[kTile];
    for (Index k = 0; k < kTile; ++k) sum[k] = 0.0;
    for (Index j = 0; j < A.n; ++j) {
      const double* const column = &A(first, j);
      for (Index k = 0; k < rows; ++k) sum[k] = fma_(column[k], v[j], sum[k]);
    }
    for (Index k = 0; k < rows; ++k) store(first + k, sum[k]);
  });
}

}  // namespace stiction::inline STICTION_ISA
