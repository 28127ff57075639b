#pragma once

#include "core/algorithm/linear/block/block_diagonal.hpp"
#include "core/algorithm/linear/krylov/cg.hpp"

/// Smoothing by polynomials of degree two in D^-1 H, D the diagonal blocks of H (docs/math/multigrid.md).
namespace stiction::inline STICTION_ISA {

/// Sweeps of damped block Jacobi before and after each visit of the coarser level.
inline constexpr Index kSweeps = 2;

/// Damping factors of the two sweeps whose product of errors is the Chebyshev polynomial of degree two on [bound / 8,
/// bound] (Saad 2003, section 12.3.2). Its zeros are theta +- delta / sqrt 2, theta = 9/16 bound and delta = 7/16
/// bound. Its absolute value is below 1 from 0 to 9/8 bound. An eigenvalue may therefore be that much above the bound
/// before a cycle ceases to be positive definite.
struct SweepWeights {
  double weight[kSweeps];
};
STICTION_HD SweepWeights sweep_weights(double bound) {
  const double theta = 0.5625 * bound;
  const double zero = 0.30935921676911446 * bound;
  return {{div_(1.0, theta + zero), div_(1.0, theta - zero)}};
}

/// A level's matrix and its diagonal blocks. A body without neighbours is solved exactly by each sweep.
struct Smoother {
  BlockMatrix H;
  BlockDiagonal D;

  [[nodiscard]] STICTION_HD double damping(Index row, double weight) const {
    return H.pattern.offsets[row + 1] - H.pattern.offsets[row] > 1 ? weight : 1.0;
  }

  /// t = r - H z.
  template <Team TeamT>
  STICTION_HD_OUTLINE void residual(TeamT& team, const double* r, const double* z, double* t) const {
    for_each(team, H.pattern.rows, [&](Index row) {
      double sum[kBodyBlock];
      const Offset first = static_cast<Offset>(row) * kBodyBlock;
      for (Index i = 0; i < kBodyBlock; ++i) sum[i] = 0.0 - r[first + i];
      multiply_row(H, row, z, sum);
      for (Index i = 0; i < kBodyBlock; ++i) t[first + i] = 0.0 - sum[i];
    });
  }

  /// z = weight D^-1 r, the sweep that begins at zero.
  template <Team TeamT>
  STICTION_HD_OUTLINE void first_sweep(TeamT& team, double weight, const double* r, double* z) const {
    for_each(team, H.pattern.rows, [&](Index row) {
      double change[kBodyBlock];
      const Offset first = static_cast<Offset>(row) * kBodyBlock;
      for (Index i = 0; i < kBodyBlock; ++i) change[i] = r[first + i];
      D.solve(row, change);
      const double damped = damping(row, weight);
      for (Index i = 0; i < kBodyBlock; ++i) z[first + i] = damped * change[i];
    });
  }

  /// z = z + weight D^-1 (r - H z); t is scratch.
  template <Team TeamT>
  STICTION_HD_OUTLINE void sweep(TeamT& team, double weight, const double* r, double* z, double* t) const {
    residual(team, r, z, t);
    for_each(team, H.pattern.rows, [&](Index row) {
      const Offset first = static_cast<Offset>(row) * kBodyBlock;
      D.solve(row, t + first);
      const double damped = damping(row, weight);
      for (Index i = 0; i < kBodyBlock; ++i) z[first + i] = fma_(damped, t[first + i], z[first + i]);
    });
  }
};

/// Steps of the power method, and the factor of its answer, which is never too large. The test of the smoother
/// compares with the exact eigenvalue.
inline constexpr Index kPowerSteps = 12;
inline constexpr double kPowerMargin = 1.1;

/// Estimates from below the largest eigenvalue of D^-1 H by the power method (Golub and Van Loan 2013, section 8.2.1)
/// from a fixed vector. The estimate is y'Hy / y'Dy, on every lane. `y` and `h` are scratch. The vectors grow by less
/// than that eigenvalue in each step, so they are not scaled. In exact arithmetic no quotient is below the one before.
template <Team TeamT>
STICTION_HD_OUTLINE double largest_eigenvalue(TeamT& team, const Smoother& smoother, double* y, double* h) {
  const Index n = smoother.H.pattern.rows * kBodyBlock;
  for_each(team, n, [&](Index i) {
    const auto mixed = (static_cast<std::uint32_t>(i) + 1U) * 2654435761U;
    y[i] = static_cast<double>(mixed >> 8U) * 0x1p-23 - 1.0;
  });
  double largest = 1.0;
  multiply_blocks(team, smoother.H, y, h);
  for (Index step = 0; step < kPowerSteps; ++step) {
    smoother.D.apply(team, h, y);
    const double weight = dot_product(team, n, y, h);
    multiply_blocks(team, smoother.H, y, h);
    const double energy = dot_product(team, n, y, h);
    if (weight > 0.0 && energy > 0.0) largest = div_(energy, weight);
  }
  return largest;
}

}  // namespace stiction::inline STICTION_ISA
