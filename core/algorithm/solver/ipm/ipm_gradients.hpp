#pragma once

#include "core/algorithm/solver/ipm/ipm_space.hpp"

/// An interior point's linear system K = Q' (A + diag R) Q + D without a matrix. It is solved by conjugate gradients,
/// preconditioned by the cones' own blocks of K (docs/math/ipm.md). Nothing here is reached by an environment that has
/// room for K.
namespace stiction::inline STICTION_ISA {

/// Accuracy of conjugate gradients, relative to the force in the preconditioner's norm. Their remainder is a linear
/// residual like any other, which the next iteration sees. The force itself falls with the complementarity.
inline constexpr double kStartAccuracy = 1e-3;
inline constexpr double kPredictorAccuracy = 1e-2;
inline constexpr double kCorrectorAccuracy = 1e-3;
/// Steps for one linear system at most.
inline constexpr Index kMostConeSteps = 1000;

/// K as an operator. p.work is its scratch.
template <class System>
struct IpmOperator {
  const System* s;
  const IpmSpace* p;

  template <Team TeamT>
  STICTION_HD_OUTLINE void apply(TeamT& team, const double* v, double* out) const {
    double* const turned = p->work;
    s->for_each_cone(team, [&](auto shape, Index, Index row) {
      using Shape = decltype(shape);
      double part[Shape::kRows];
      load(v, row, part);
      if constexpr (Shape::kKind == ConeKind::friction) p->template scaling<Shape::kRows>(row).from_frame(part);
      store(part, turned, row);
    });
    prepare_wide_product(team, *s, turned);
    s->for_each_cone(team, [&](auto shape, Index, Index row) {
      using Shape = decltype(shape);
      double part[Shape::kRows];
      for (int k = 0; k < Shape::kRows; ++k) part[k] = wide_row(*s, row + k, turned);
      if constexpr (Shape::kKind == ConeKind::friction) p->template scaling<Shape::kRows>(row).to_frame(part);
      for (int k = 0; k < Shape::kRows; ++k) out[row + k] = fma_(p->diagonal[row + k], v[row + k], part[k]);
    });
  }
};

/// K becomes Q' K Q.
template <int M>
STICTION_HD void turn_block(const ConeScaling<M>& frame, double (&K)[M][M]) {
  for (int i = 0; i < M; ++i) frame.to_frame(K[i]);
  for (int j = 0; j < M; ++j) {
    double column[M];
    for (int i = 0; i < M; ++i) column[i] = K[i][j];
    frame.to_frame(column);
    for (int i = 0; i < M; ++i) K[i][j] = column[i];
  }
}

/// To be called when p.diagonal or the frames are new.
template <Team TeamT, class System>
STICTION_HD void prepare_gradients(TeamT& team, const System& s, const IpmSpace& p) {
  s.for_each_cone(team, [&](auto shape, Index, Index row) {
    using Shape = decltype(shape);
    constexpr int kRows = Shape::kRows;
    double K[kRows][kRows];
    read_cone_block(s, row, K);
    if constexpr (Shape::kKind == ConeKind::friction) turn_block<kRows>(p.template scaling<kRows>(row), K);
    for (int k = 0; k < kRows; ++k) K[k][k] = K[k][k] + p.diagonal[row + k];
    factor_cone_block(K, cone_block(p.cone_factor, row));
  });
}

/// step = K^-1 force to `accuracy`, or as near as kMostConeSteps come. Overwrites work.
template <Team TeamT, class System>
STICTION_HD_OUTLINE void solve_by_gradients(TeamT& team, const System& s, const IpmSpace& p, double accuracy) {
  conjugate_gradient(team, IpmOperator<System>{&s, &p}, {p.n, p.force, p.step, p.gradients, accuracy, kMostConeSteps},
                     ConeBlocks<System>{&s, p.cone_factor});
}

/// step = (A + diag force)^-1 step, for the start. Overwrites work and dual_step. There is no reflection yet:
/// in the frames diag force is diagonal too, twice as large where a vector has length sqrt 2.
template <Team TeamT, class System>
STICTION_HD_OUTLINE void start_by_gradients(TeamT& team, const System& s, const IpmSpace& p) {
  s.for_each_cone(team, [&](auto shape, Index, Index row) {
    using Shape = decltype(shape);
    double part[Shape::kRows];
    load(p.step, row, part);
    for (int k = 0; k < Shape::kRows; ++k) {
      const bool is_long = Shape::kKind == ConeKind::friction && k < 2;
      p.dual_step[row + k] = p.force[row + k];
      p.diagonal[row + k] = (is_long ? 2.0 : 1.0) * p.force[row + k];
    }
    if constexpr (Shape::kKind == ConeKind::friction) p.template scaling<Shape::kRows>(row).to_frame(part);
    store(part, p.force, row);
  });
  prepare_gradients(team, s, p);
  solve_by_gradients(team, s, p, kStartAccuracy);
  s.for_each_cone(team, [&](auto shape, Index, Index row) {
    using Shape = decltype(shape);
    double part[Shape::kRows];
    load(p.step, row, part);
    if constexpr (Shape::kKind == ConeKind::friction) p.template scaling<Shape::kRows>(row).from_frame(part);
    store(part, p.step, row);
    for (int k = 0; k < Shape::kRows; ++k) p.force[row + k] = p.dual_step[row + k];
  });
}

}  // namespace stiction::inline STICTION_ISA
