#pragma once

#include "core/body/ipm/ipm_space.hpp"

/// An interior point's linear system K = Q' (A + diag R) Q + D without a matrix: conjugate gradients, preconditioned by
/// the cones' own blocks of K (docs/math/ipm.md). Nothing here is reached by an environment that has room for K.
namespace stiction::inline STICTION_ISA {

/// How far conjugate gradients go, relative to the force in the norm that the preconditioner makes. What they leave is
/// a linear residual like any other, which the next iteration sees. The force itself falls with the complementarity.
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

  template <Block B>
  STICTION_HD_OUTLINE void apply(B& block, const double* v, double* out) const {
    double* const turned = p->work;
    s->for_each_cone(block, [&](auto shape, Index, Index row) {
      using Shape = decltype(shape);
      double part[Shape::kRows];
      load(v, row, part);
      if constexpr (Shape::kKind == ConeKind::friction) p->template scaling<Shape::kRows>(row).from_frame(part);
      store(part, turned, row);
    });
    prepare_wide_product(block, *s, turned);
    s->for_each_cone(block, [&](auto shape, Index, Index row) {
      using Shape = decltype(shape);
      double part[Shape::kRows];
      for (int k = 0; k < Shape::kRows; ++k) part[k] = wide_row(*s, row + k, turned);
      if constexpr (Shape::kKind == ConeKind::friction) p->template scaling<Shape::kRows>(row).to_frame(part);
      for (int k = 0; k < Shape::kRows; ++k) out[row + k] = fma_(p->diagonal[row + k], v[row + k], part[k]);
    });
  }
};

/// The inverse of the cones' blocks of K.
template <class System>
struct ConeBlocks {
  const System* s;
  const IpmSpace* p;

  /// Factor L L' of every block, in its lower triangle.
  template <Block B>
  STICTION_HD_OUTLINE void prepare(B& block) const {
    s->for_each_cone(block, [&](auto shape, Index, Index row) {
      using Shape = decltype(shape);
      constexpr int kRows = Shape::kRows;
      double K[kRows][kRows];
      for (int i = 0; i < kRows; ++i)
        for (int j = 0; j < kRows; ++j)
          K[i][j] =
              0.5 * (static_cast<double>(s->block_entry(row, i, j)) + static_cast<double>(s->block_entry(row, j, i)));
      if constexpr (Shape::kKind == ConeKind::friction) turn_block<kRows>(p->template scaling<kRows>(row), K);
      factor_block<kRows>(K, p->diagonal + row, factor(row));
    });
  }

  template <Block B>
  STICTION_HD_OUTLINE void apply(B& block, const double* r, double* z) const {
    s->for_each_cone(block, [&](auto shape, Index, Index row) {
      constexpr int kRows = decltype(shape)::kRows;
      const double* const L = factor(row);
      double v[kRows];
      load(r, row, v);
      for (int i = 0; i < kRows; ++i) {
        for (int k = 0; k < i; ++k) v[i] = fma_(0.0 - L[i * kRows + k], v[k], v[i]);
        v[i] = div_(v[i], L[i * kRows + i]);
      }
      for (int i = kRows - 1; i >= 0; --i) {
        for (int k = i + 1; k < kRows; ++k) v[i] = fma_(0.0 - L[k * kRows + i], v[k], v[i]);
        v[i] = div_(v[i], L[i * kRows + i]);
      }
      store(v, z, row);
    });
  }

 private:
  [[nodiscard]] STICTION_HD double* factor(Index row) const {
    return p->cone_factor + static_cast<Offset>(row) * kMaxConeRows;
  }

  /// K becomes Q' K Q.
  template <int M>
  static STICTION_HD void turn_block(const ConeScaling<M>& frame, double (&K)[M][M]) {
    for (int i = 0; i < M; ++i) frame.to_frame(K[i]);
    for (int j = 0; j < M; ++j) {
      double column[M];
      for (int i = 0; i < M; ++i) column[i] = K[i][j];
      frame.to_frame(column);
      for (int i = 0; i < M; ++i) K[i][j] = column[i];
    }
  }

  /// L of K + diag D. A pivot that rounding has made zero or less is replaced: its direction is then left alone.
  template <int M>
  static STICTION_HD void factor_block(const double (&K)[M][M], const double* D, double* L) {
    constexpr double kOutOfReach = 0x1p+500;
    for (int j = 0; j < M; ++j) {
      double pivot = K[j][j] + D[j];
      for (int k = 0; k < j; ++k) pivot = fma_(0.0 - L[j * M + k], L[j * M + k], pivot);
      const double root = pivot > 0.0 ? sqrt_(pivot) : kOutOfReach;
      L[j * M + j] = root;
      for (int i = j + 1; i < M; ++i) {
        double entry = K[i][j];
        for (int k = 0; k < j; ++k) entry = fma_(0.0 - L[i * M + k], L[j * M + k], entry);
        L[i * M + j] = div_(entry, root);
      }
    }
  }
};

/// To be called when p.diagonal or the frames are new.
template <Block B, class System>
STICTION_HD void prepare_gradients(B& block, const System& s, const IpmSpace& p) {
  ConeBlocks<System>{&s, &p}.prepare(block);
}

/// step = K^-1 force to `accuracy`, or as near as kMostConeSteps come. Overwrites work.
template <Block B, class System>
STICTION_HD_OUTLINE void solve_by_gradients(B& block, const System& s, const IpmSpace& p, double accuracy) {
  solve_gradients(block, IpmOperator<System>{&s, &p}, {p.n, p.force, p.step, p.gradients, accuracy, kMostConeSteps},
                  ConeBlocks<System>{&s, &p});
}

/// step = (A + diag force)^-1 step, for the start. Overwrites work and dual_step. There is no reflection yet:
/// in the frames diag force is diagonal too, twice as large where a vector has length sqrt 2.
template <Block B, class System>
STICTION_HD_OUTLINE void start_by_gradients(B& block, const System& s, const IpmSpace& p) {
  s.for_each_cone(block, [&](auto shape, Index, Index row) {
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
  prepare_gradients(block, s, p);
  solve_by_gradients(block, s, p, kStartAccuracy);
  s.for_each_cone(block, [&](auto shape, Index, Index row) {
    using Shape = decltype(shape);
    double part[Shape::kRows];
    load(p.step, row, part);
    if constexpr (Shape::kKind == ConeKind::friction) p.template scaling<Shape::kRows>(row).from_frame(part);
    store(part, p.step, row);
    for (int k = 0; k < Shape::kRows; ++k) p.force[row + k] = p.dual_step[row + k];
  });
}

}  // namespace stiction::inline STICTION_ISA
