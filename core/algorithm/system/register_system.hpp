#pragma once

#include "core/algorithm/system/dense_system.hpp"
#include "core/team/phases.hpp"

namespace stiction::inline STICTION_ISA {

/// kCount numbers that are indexed by constants only, so that a compiler can keep each in a register.
template <class Real, int kCount>
struct Numbers {
  Real value[kCount];
  STICTION_HD Real& operator[](Index i) { return value[i]; }
  STICTION_HD const Real& operator[](Index i) const { return value[i]; }
};

/// A view of a dense system of up to kCones friction cones of three rows, nothing else, whose A equals its transpose
/// to the bit. It lasts as long as a few sweeps take. x, y and half of A are members. Data that a sweep reads once per
/// cone stays where it lies.
///
/// Every loop has constant bounds and tests by constant indices whether a cone exists. No index is hence left to be
/// known at run time: a GPU has no address for a register. Rows beyond the environment's own hold zeros. No sweep
/// visits their cones and nothing of theirs is stored, so whatever is pushed into their y reaches no row that exists.
template <class RealType, int kCones, int kStride>
struct RegisterSystem {
  using Real = RealType;
  using Dense = DenseSystem<Real, kStride>;
  using Shape = ConeShape<ConeKind::friction, 3>;
  static constexpr bool kMaintainsMotion = true;
  static constexpr int kRows = kCones * Shape::kRows;

  AtMost<kRows> n;                         ///< rows
  Index cones;                             ///< cones
  Numbers<Real, kRows> x;                  ///< the iterate
  Numbers<Real, kRows> y;                  ///< motion (A + R) x + b
  Real A[kRows * (kRows + 1) / 2];         ///< upper triangle of A + diag R, column by column
  Strided<Real, kStride> residual_weight;  ///< as in SystemArrays, like the others below    (cones)
  Strided<Real, kStride> inv_n;            ///<                                              (cones)
  Strided<Real, kStride> inv_t;            ///<                                              (cones)
  Strided<Real, kStride> damping;          ///<                                              (cones)
  Strided<Real, kStride> share;            ///<                                              (cones)
  Strided<Real, kStride> scalar;           ///<                                              (kStateScalars)
  Strided<Real, kStride> extra;            ///<                                              (method * n)

  STICTION_HD explicit RegisterSystem(const Dense& s)
      : n{s.n},
        cones(s.cones),
        residual_weight(s.residual_weight),
        inv_n(s.inv_n),
        inv_t(s.inv_t),
        damping(s.damping),
        share(s.share),
        scalar(s.scalar),
        extra(s.extra) {
    STICTION_UNROLL
    for (int j = 0; j < kRows; ++j) {
      const bool exists = j < n.count;
      const Strided<Real, kStride> column = s.A.from(Offset{j} * n.count);
      x[j] = exists ? s.x[j] : Real(0);
      y[j] = exists ? s.y[j] : Real(0);
      STICTION_UNROLL
      for (int i = 0; i <= j; ++i) A[packed(i, j)] = exists ? column[i] : Real(0);
    }
  }

  /// Copies x and y back to memory; iterations change nothing else that is kept in registers.
  STICTION_HD void store(const Dense& s) const {
    STICTION_UNROLL
    for (int i = 0; i < kRows; ++i)
      if (i < n.count) {
        s.x[i] = x[i];
        s.y[i] = y[i];
      }
  }

  [[nodiscard]] STICTION_HD Real entry(int i, int j) const { return A[i <= j ? packed(i, j) : packed(j, i)]; }
  [[nodiscard]] STICTION_HD Real block_entry(Index row, int i, int j) const { return entry(row + i, row + j); }
  [[nodiscard]] STICTION_HD Strided<Real, kStride> vector(Index k) const { return extra.from(Offset{k} * n.count); }

  /// f(shape, cone, row) for every cone, in canonical order.
  template <class F>
  STICTION_HD void for_each_in_order(F&& f) const {
    STICTION_UNROLL
    for (int cone = 0; cone < kCones; ++cone)
      if (cone < cones) f(Shape{}, cone, cone * Shape::kRows);
  }

  /// y += A[:, row .. row+M) * d: the push of one cone's change.
  template <int M, Team TeamT>
  STICTION_HD void push(TeamT&, Index row, const Real (&d)[M]) {
    STICTION_UNROLL
    for (int i = 0; i < kRows; ++i) {
      STICTION_UNROLL
      for (int k = 0; k < M; ++k) y[i] = fma_(entry(i, row + k), d[k], y[i]);
    }
  }

 private:
  static STICTION_HD constexpr int packed(int i, int j) { return j * (j + 1) / 2 + i; }
};

}  // namespace stiction::inline STICTION_ISA
