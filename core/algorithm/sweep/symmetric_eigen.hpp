#pragma once

#include "core/base/real.hpp"

namespace stiction::inline STICTION_ISA {

/// Passes over all pairs after which the off-diagonal part of a matrix of N rows is below rounding. One rotation does
/// for two rows, and from three rows on convergence is quadratic once it has begun.
template <int N>
inline constexpr int kJacobiPasses = N < 3 ? 1 : 6;

/// S = V diag(e) V' of a symmetric S by cyclic Jacobi rotations (Golub and Van Loan 2013, section 8.5), in a fixed
/// number of passes. V is orthogonal up to rounding whatever S is; S is used up. kGraded: entries may be so small
/// beside others that their squares vanish.
template <int N, bool kGraded = false, class Real>
STICTION_HD void symmetric_eigen(Real (&S)[N][N], Real (&V)[N][N], Real (&e)[N]) {
  for (int i = 0; i < N; ++i)
    for (int j = 0; j < N; ++j) V[i][j] = Real(i == j ? 1 : 0);
  for (int pass = 0; pass < kJacobiPasses<N>; ++pass)
    for (int p = 0; p + 1 < N; ++p)
      for (int q = p + 1; q < N; ++q) {
        // The smaller root t of t^2 + (gap / off) t = 1, which turns by at most 45 degrees; 0 where nothing is off.
        const Real off = Real(2) * S[p][q];
        const Real gap = S[q][q] - S[p][p];
        const Real reach = abs_(gap) + sqrt_(fma_(gap, gap, off * off));
        Real ratio = select(reach > Real(0), div_(off, reach), Real(0));
        // With such numbers `reach` may be next to nothing. To turn by 45 degrees then errs by no more than `off`.
        if constexpr (kGraded) ratio = clamp_(ratio, Real(-1), Real(1));
        const Real t = select(gap < Real(0), Real(0) - ratio, ratio);
        const Real c = div_(Real(1), sqrt_(fma_(t, t, Real(1))));
        const Real s = t * c;
        const Real shift = t * S[p][q];
        S[p][p] = S[p][p] - shift;
        S[q][q] = S[q][q] + shift;
        S[p][q] = S[q][p] = Real(0);
        for (int k = 0; k < N; ++k) {
          if (k != p && k != q) {
            const Real left = S[k][p];
            const Real right = S[k][q];
            S[k][p] = S[p][k] = fma_(c, left, (Real(0) - s) * right);
            S[k][q] = S[q][k] = fma_(s, left, c * right);
          }
          const Real left = V[k][p];
          const Real right = V[k][q];
          V[k][p] = fma_(c, left, (Real(0) - s) * right);
          V[k][q] = fma_(s, left, c * right);
        }
      }
  for (int i = 0; i < N; ++i) e[i] = S[i][i];
}

}  // namespace stiction::inline STICTION_ISA
