#pragma once

#include "core/algorithm/solver/newton/natural_slope.hpp"
#include "core/algorithm/solver/newton/newton_workspace.hpp"

/// The linear system of the proximal branch, F' d = -F, without a matrix. F' is not symmetric, so it is solved by
/// stabilized gradients, preconditioned by the inverses of the cones' own blocks (docs/math/newton.md). Nothing here
/// is reached by an environment that has room for a matrix.
namespace stiction::inline STICTION_ISA {

/// Part of the residual that a step's gradients leave, in length.
inline constexpr double kProximalAccuracy = 1e-1;
/// Steps for one linear system at most.
inline constexpr Index kMostProximalSteps = 250;

/// Keeps a cone's slope for the operator.
template <int M>
STICTION_HD void keep_slope(const NewtonWorkspace& workspace, Index row, const NaturalSlope<M>& slope) {
  for (int i = 0; i < M; ++i) {
    workspace.vector(kTurned)[row + i] = slope.turn[i];
    for (int k = 0; k < M; ++k)
      workspace.vector(kDerivative)[Offset{kConeBlockWorkspace} * (row + i) + k] = slope.P[i][k];
  }
}
template <int M, class System>
STICTION_HD NaturalSlope<M> kept_slope(const System& s, Index cone, Index row, double prox_weight) {
  const NewtonWorkspace workspace = newton_room(s);
  NaturalSlope<M> slope;
  for (int i = 0; i < M; ++i) {
    slope.turn[i] = workspace.vector(kTurned)[row + i];
    for (int k = 0; k < M; ++k)
      slope.P[i][k] = workspace.vector(kDerivative)[Offset{kConeBlockWorkspace} * (row + i) + k];
  }
  slope.D = natural_step(s, cone);
  slope.prox_weight = prox_weight;
  return slope;
}

/// F'.
template <class System>
struct NaturalOperator {
  const System* s;
  double prox_weight;

  template <Team TeamT>
  STICTION_HD_OUTLINE void apply(TeamT& team, const double* v, double* out) const {
    prepare_wide_product(team, *s, v);
    s->for_each_cone(team, [&](auto shape, Index cone, Index row) {
      constexpr int kRows = decltype(shape)::kRows;
      double own[kRows];
      double image[kRows];
      double result[kRows];
      load(v, row, own);
      for (int k = 0; k < kRows; ++k) image[k] = wide_row(*s, row + k, v);
      kept_slope<kRows>(*s, cone, row, prox_weight).apply(own, image, result);
      store(result, out, row);
    });
  }
};

/// The inverse of K by elimination of rows with the largest pivots. A column without a pivot is a direction that K does
/// not see: it is left as it is.
template <int M>
STICTION_HD_OUTLINE void invert_cone_block(double (&K)[M][M], double* inverse) {
  double X[M][M];
  for (int i = 0; i < M; ++i)
    for (int j = 0; j < M; ++j) X[i][j] = i == j ? 1.0 : 0.0;
  for (int j = 0; j < M; ++j) {
    int best = j;
    for (int i = j + 1; i < M; ++i)
      if (abs_(K[i][j]) > abs_(K[best][j])) best = i;
    const double pivot = K[best][j];
    if (!(abs_(pivot) > 0.0)) continue;
    for (int k = 0; k < M; ++k) {
      const double K_k = K[j][k];
      const double X_k = X[j][k];
      K[j][k] = div_(K[best][k], pivot);
      X[j][k] = div_(X[best][k], pivot);
      if (best != j) {
        K[best][k] = K_k;
        X[best][k] = X_k;
      }
    }
    for (int i = 0; i < M; ++i) {
      if (i == j) continue;
      const double factor = K[i][j];
      for (int k = 0; k < M; ++k) {
        K[i][k] = fma_(0.0 - factor, K[j][k], K[i][k]);
        X[i][k] = fma_(0.0 - factor, X[j][k], X[i][k]);
      }
    }
  }
  for (int i = 0; i < M; ++i)
    for (int j = 0; j < M; ++j) inverse[i * M + j] = X[i][j];
}

/// The cones' blocks, inverted, as a preconditioner.
template <class System>
struct InvertedBlocks {
  const System* s;

  template <Team TeamT>
  STICTION_HD_OUTLINE void apply(TeamT& team, const double* r, double* z) const {
    s->for_each_cone(team, [&](auto shape, Index, Index row) {
      constexpr int kRows = decltype(shape)::kRows;
      const double* const inverse = cone_block(newton_room(*s).vector(kConeFactors), row);
      double v[kRows];
      double product[kRows];
      load(r, row, v);
      for (int i = 0; i < kRows; ++i) {
        product[i] = 0.0;
        for (int k = 0; k < kRows; ++k) product[i] = fma_(inverse[i * kRows + k], v[k], product[i]);
      }
      store(product, z, row);
    });
  }
};

/// A cone's slope kept, and its own block of F' inverted.
template <int M, class System>
STICTION_HD void prepare_slope(const System& s, Index row, const NaturalSlope<M>& slope) {
  const NewtonWorkspace workspace = newton_room(s);
  keep_slope(workspace, row, slope);
  double K[M][M];
  for (int j = 0; j < M; ++j) {
    double v[M];
    double image[M];
    double column[M];
    for (int k = 0; k < M; ++k) {
      v[k] = k == j ? 1.0 : 0.0;
      image[k] = static_cast<double>(s.block_entry(row, k, j));
    }
    slope.apply(v, image, column);
    for (int k = 0; k < M; ++k) K[k][j] = column[k];
  }
  invert_cone_block(K, cone_block(workspace.vector(kConeFactors), row));
}

/// kStep becomes the solution for the right-hand side that it is. Overwrites kUnknown.
template <Team TeamT, class System>
STICTION_HD_OUTLINE void solve_natural_by_gradients(TeamT& team, const System& s, double prox_weight) {
  const NewtonWorkspace workspace = newton_room(s);
  double* const d = workspace.vector(kStep);
  double* const force = workspace.vector(kUnknown);
  for_each(team, s.n, [&](Index i) { force[i] = d[i]; });
  bicgstab(team, NaturalOperator<System>{&s, prox_weight},
           {s.n, force, d, workspace.vector(kGradients), kProximalAccuracy, kMostProximalSteps},
           InvertedBlocks<System>{&s});
}

}  // namespace stiction::inline STICTION_ISA
