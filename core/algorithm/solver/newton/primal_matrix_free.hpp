#pragma once

#include "core/algorithm/newton/cone_response.hpp"
#include "core/algorithm/solver/newton/newton_workspace.hpp"

/// The linear system of the primal branch, (I + C'AC) t = C'A r, without a matrix: conjugate gradients, preconditioned
/// by the cones' own blocks (docs/math/newton.md). Nothing here is reached by an environment that has room for a
/// matrix.
namespace stiction::inline STICTION_ISA {

/// Part of the residual that a step's conjugate gradients leave, in the norm that the preconditioner makes: the forcing
/// term of an inexact Newton method.
inline constexpr double kPrimalAccuracy = 1e-3;
/// Accuracy where that did not lead downhill: because there is nothing left to gain, or for want of accuracy.
inline constexpr double kPrimalCare = 1e-9;
/// Steps for one linear system at most.
inline constexpr Index kMostPrimalSteps = 500;

/// A guess of t in kGuess: C'H r, H being R and the curvature of the cone's boundary. It subtracts from r the cone's
/// own answer. (C C'H projects onto the directions in which its reaction can change.) The residual that is left is
/// then that of the cones' own laws instead of a reaction's.
template <class Shape, int M>
STICTION_HD void guess_unknown(Shape, const NewtonWorkspace& workspace, Index row, const CompliantPoint<M>& point,
                               const double (&R)[M], const double (&C)[M][M]) {
  double force[M];
  double along = 0.0;
  for (int k = 0; k < M; ++k) force[k] = R[k] * workspace.vector(kGap)[row + k];
  if constexpr (Shape::kKind == ConeKind::friction)
    if (point.contact_state == kSliding) {
      for (int k = 1; k < M; ++k) along = fma_(point.s[k], workspace.vector(kGap)[row + k], along);
      for (int k = 1; k < M; ++k) {
        const double across = fma_(0.0 - along, point.s[k], workspace.vector(kGap)[row + k]);
        force[k] = fma_(point.stiffness, across, force[k]);
      }
    }
  for (int j = 0; j < M; ++j) {
    double sum = 0.0;
    for (int k = 0; k < M; ++k) sum = fma_(C[k][j], force[k], sum);
    workspace.vector(kGuess)[row + j] = sum;
  }
}

/// I + C'AC. kTurned is its scratch.
template <class System>
struct CurvatureOperator {
  const System* s;

  template <Team TeamT>
  STICTION_HD_OUTLINE void apply(TeamT& team, const double* v, double* out) const {
    const NewtonWorkspace workspace = newton_room(*s);
    const double* const C = workspace.vector(kFactor);
    double* const turned = workspace.vector(kTurned);
    s->for_each_cone(team, [&](auto shape, Index, Index row) {
      constexpr int kRows = decltype(shape)::kRows;
      for (int k = 0; k < kRows; ++k) {
        double sum = 0.0;
        for (int j = 0; j < kRows; ++j) sum = fma_(C[Offset{6} * (row + k) + j], v[row + j], sum);
        turned[row + k] = sum;
      }
    });
    prepare_wide_product(team, *s, turned);
    s->for_each_cone(team, [&](auto shape, Index, Index row) {
      constexpr int kRows = decltype(shape)::kRows;
      double sum[kRows];
      for (int j = 0; j < kRows; ++j) sum[j] = v[row + j];
      for (int k = 0; k < kRows; ++k) {
        const double motion = wide_row(*s, row + k, turned, 0.0);
        for (int j = 0; j < kRows; ++j) sum[j] = fma_(C[Offset{6} * (row + k) + j], motion, sum[j]);
      }
      for (int j = 0; j < kRows; ++j) out[row + j] = sum[j];
    });
  }
};

/// Factors of the cones' blocks of I + C'AC.
template <Team TeamT, class System>
STICTION_HD_OUTLINE void prepare_curvature(TeamT& team, const System& s) {
  const NewtonWorkspace workspace = newton_room(s);
  s.for_each_cone(team, [&](auto shape, Index, Index row) {
    constexpr int kRows = decltype(shape)::kRows;
    const double* const C = workspace.vector(kFactor) + Offset{6} * row;
    double A[kRows][kRows];
    double K[kRows][kRows];
    read_cone_block(s, row, A);
    for (int k = 0; k < kRows; ++k) A[k][k] = workspace.vector(kDiagonal)[row + k];
    for (int j = 0; j < kRows; ++j) {
      double image[kRows];
      for (int k = 0; k < kRows; ++k) {
        image[k] = 0.0;
        for (int l = 0; l < kRows; ++l) image[k] = fma_(A[k][l], C[6 * l + j], image[k]);
      }
      for (int i = 0; i < kRows; ++i) {
        K[i][j] = i == j ? 1.0 : 0.0;
        for (int k = 0; k < kRows; ++k) K[i][j] = fma_(C[6 * k + i], image[k], K[i][j]);
      }
    }
    factor_cone_block(K, cone_block(workspace.vector(kConeFactors), row));
  });
}

/// kUnknown becomes the solution for the right-hand side that it is. Overwrites kImage.
template <Team TeamT, class System>
STICTION_HD_OUTLINE void solve_curvature_by_gradients(TeamT& team, const System& s, double accuracy) {
  const NewtonWorkspace workspace = newton_room(s);
  double* const t = workspace.vector(kUnknown);
  double* const found = workspace.vector(kImage);
  conjugate_gradient(team, CurvatureOperator<System>{&s},
                     {s.n, t, found, workspace.vector(kGradients), accuracy, kMostPrimalSteps},
                     ConeBlocks<System>{&s, workspace.vector(kConeFactors)});
  for_each(team, s.n, [&](Index i) { t[i] = found[i]; });
}

}  // namespace stiction::inline STICTION_ISA
