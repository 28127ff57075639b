#pragma once

#include "core/algorithm/load/step_sizes.hpp"
#include "core/algorithm/sweep/local_solve.hpp"

/// A cone's step of a sweep in double. The step is local_step() itself, of a system that is one cone.
namespace stiction::inline STICTION_ISA {

/// One cone as a system of the sweeps: its block, step lengths, bounds, reaction.
template <int M>
struct LoneCone {
  using Real = double;
  double B[M][M];
  double x[M];
  double inv_n[1];
  double inv_t[1];
  double damping[1];
  double share[1];
  double lo[1];
  double hi[1];

  [[nodiscard]] STICTION_HD double block_entry(Index, int i, int j) const { return B[i][j]; }

  /// Step lengths from the block, as step_sizes.hpp has them.
  STICTION_HD void measure() {
    inv_n[0] = inverse_of_positive(B[0][0]);
    inv_t[0] = share[0] = 0.0;
    damping[0] = 1.0;
    if constexpr (M > 1) {
      const double whole = largest_eigenvalue_bound<M, 0>(*this, 0),
                   tangential = largest_eigenvalue_bound<M, 1>(*this, 0);
      inv_t[0] = inverse_of_positive(max_(tangential, whole * static_cast<double>(kSmallestTangential)));
      const BlockMetric<double> metric = block_metric<M>(*this, 0, inv_n[0], inv_t[0]);
      damping[0] = metric.damping;
      share[0] = metric.share;
    }
  }
};

/// Derivatives of a loss by the parts of a LoneCone.
template <int M>
struct LoneConeBar {
  double B[M][M] = {};
  double x[M] = {};
  double y[M] = {};
  double inv_n = 0.0, inv_t = 0.0, damping = 0.0, share = 0.0, lo = 0.0, hi = 0.0;
};

}  // namespace stiction::inline STICTION_ISA
