#pragma once

#include "core/algorithm/load/step_sizes.hpp"
#include "core/algorithm/sweep/local_solve.hpp"

/// A cone's step of a sweep in double, and the same step in reverse (docs/math/derivative.md, (28) to (31)). The step
/// is local_step() itself, of a system that is one cone.
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

/// The transposed derivative of project_second_order_cone() at z, of `bar`; adds that by the share.
template <int M>
STICTION_HD void pull_cone_projection(const double (&z)[M], double share, double (&bar)[M], double& by_share) {
  const double length = tangential_norm<M>(z);
  if (length <= z[0]) return;
  const double middle = fma_(share, length, (1.0 - share) * z[0]);
  const bool polar = share * length <= 0.0 - (1.0 - share) * z[0] || middle <= 0.0;
  double along = 0.0;
  for (int k = 1; k < M; ++k) along = fma_(div_(z[k], length), bar[k], along);
  const double by_middle = polar ? 0.0 : bar[0] + along;
  by_share = fma_(length - z[0], by_middle, by_share);
  for (int k = 1; k < M; ++k) {
    const double u = div_(z[k], length);
    bar[k] = polar ? 0.0 : fma_(u, share * by_middle, div_(middle, length) * (bar[k] - u * along));
  }
  bar[0] = (1.0 - share) * by_middle;
}

/// Friction under Coulomb's law, in reverse: `bar` by the reaction after the step.
template <int M>
STICTION_HD void pull_coulomb_step(const LoneCone<M>& s, const double (&y)[M], double omega, const double (&bar)[M],
                                   LoneConeBar<M>& to) {
  const double pressed = fma_(0.0 - omega * s.inv_n[0], y[0], s.x[0]);
  const double fresh = pressed > 0.0 ? pressed : 0.0, moved = fresh - s.x[0], gain = 0.0 - omega * s.inv_t[0];
  double z[M], motion[M];
  z[0] = fresh;
  for (int k = 1; k < M; ++k) {
    motion[k] = fma_(s.B[k][0], moved, y[k]);
    z[k] = fma_(gain, motion[k], s.x[k]);
  }
  const double length = tangential_norm<M>(z);
  const bool slides = !(length <= fresh);
  double along = 0.0;
  for (int k = 1; k < M && slides; ++k) along = fma_(div_(z[k], length), bar[k], along);
  double by_fresh = bar[0] + along, by_moved = 0.0;
  for (int k = 1; k < M; ++k) {
    const double by_z = slides ? div_(fresh, length) * (bar[k] - div_(z[k], length) * along) : bar[k];
    const double by_motion = gain * by_z;
    to.x[k] = to.x[k] + by_z;
    to.y[k] = to.y[k] + by_motion;
    to.inv_t = fma_(0.0 - omega * motion[k], by_z, to.inv_t);
    to.B[k][0] = fma_(moved, by_motion, to.B[k][0]);
    by_moved = fma_(s.B[k][0], by_motion, by_moved);
  }
  by_fresh = by_fresh + by_moved;
  to.x[0] = to.x[0] - by_moved;
  if (!(pressed > 0.0)) return;
  to.x[0] = to.x[0] + by_fresh;
  to.y[0] = fma_(0.0 - omega * s.inv_n[0], by_fresh, to.y[0]);
  to.inv_n = fma_(0.0 - omega * y[0], by_fresh, to.inv_n);
}

/// Friction under the convex law, in reverse: both passes.
template <int M>
STICTION_HD void pull_convex_step(const LoneCone<M>& s, const double (&y)[M], double omega, const double (&bar)[M],
                                  LoneConeBar<M>& to) {
  const double damped = 0.0 - omega * s.damping[0];
  const double gain[2] = {damped * s.inv_n[0], damped * s.inv_t[0]};
  double z[2][M], motion[2][M], first[M], by[M];
  for (int k = 0; k < M; ++k) {
    motion[0][k] = y[k];
    first[k] = z[0][k] = fma_(gain[k > 0 ? 1 : 0], y[k], s.x[k]);
  }
  project_second_order_cone<M>(first, s.share[0]);
  for (int i = 0; i < M; ++i) {
    motion[1][i] = y[i];
    for (int j = 0; j < M; ++j) motion[1][i] = fma_(s.B[i][j], first[j] - s.x[j], motion[1][i]);
    z[1][i] = fma_(gain[i > 0 ? 1 : 0], motion[1][i], first[i]);
    by[i] = bar[i];
  }
  double by_gain[2] = {};
  const auto pull_pass = [&](int pass, double (&by_motion)[M]) {
    pull_cone_projection<M>(z[pass], s.share[0], by, to.share);
    for (int k = 0; k < M; ++k) {
      by_motion[k] = gain[k > 0 ? 1 : 0] * by[k];
      by_gain[k > 0 ? 1 : 0] = fma_(motion[pass][k], by[k], by_gain[k > 0 ? 1 : 0]);
    }
  };
  double by_motion[M];
  pull_pass(1, by_motion);
  for (int i = 0; i < M; ++i) {
    to.y[i] = to.y[i] + by_motion[i];
    for (int j = 0; j < M; ++j) {
      const double through = s.B[i][j] * by_motion[i];
      by[j] = by[j] + through;
      to.x[j] = to.x[j] - through;
      to.B[i][j] = fma_(by_motion[i], first[j] - s.x[j], to.B[i][j]);
    }
  }
  pull_pass(0, by_motion);
  for (int k = 0; k < M; ++k) {
    to.y[k] = to.y[k] + by_motion[k];
    to.x[k] = to.x[k] + by[k];
  }
  to.inv_n = fma_(damped, by_gain[0], to.inv_n);
  to.inv_t = fma_(damped, by_gain[1], to.inv_t);
  to.damping = to.damping - omega * fma_(s.inv_n[0], by_gain[0], s.inv_t[0] * by_gain[1]);
}

/// The step of any cone in reverse. Adds to `to` what `bar`, by the reaction after it, says of the cone before it.
template <Law kLaw, class Shape>
STICTION_HD void pull_local_step(Shape, const LoneCone<Shape::kRows>& s, const double (&y)[Shape::kRows], double omega,
                                 const double (&bar)[Shape::kRows], LoneConeBar<Shape::kRows>& to) {
  if constexpr (Shape::kKind == ConeKind::friction) {
    if constexpr (kLaw == Law::coulomb) {
      pull_coulomb_step(s, y, omega, bar, to);
    } else {
      pull_convex_step(s, y, omega, bar, to);
    }
  } else {
    const double z = fma_(0.0 - omega * s.inv_n[0], y[0], s.x[0]);
    if constexpr (Shape::kKind == ConeKind::box) {
      if (z < s.lo[0]) {
        to.lo = to.lo + bar[0];
        return;
      }
      if (z > s.hi[0]) {
        to.hi = to.hi + bar[0];
        return;
      }
    }
    if (Shape::kKind == ConeKind::unilateral && !(z > 0.0)) return;
    to.x[0] = to.x[0] + bar[0];
    to.y[0] = fma_(0.0 - omega * s.inv_n[0], bar[0], to.y[0]);
    to.inv_n = fma_(0.0 - omega * y[0], bar[0], to.inv_n);
  }
}

/// largest_eigenvalue_bound() f in reverse. It is (trace S^16)^(1/16) of the symmetric part S, whose derivative is
/// (S / f)^15.
template <int M, int kFirst>
STICTION_HD void pull_eigenvalue_bound(const LoneCone<M>& s, double by, LoneConeBar<M>& to) {
  const double bound = largest_eigenvalue_bound<M, kFirst>(s, 0);
  if (!(bound > 0.0)) return;
  double power[M][M] = {}, product[M][M] = {};
  for (int i = kFirst; i < M; ++i) {
    for (int j = kFirst; j < M; ++j) power[i][j] = div_(0.5 * (s.B[i][j] + s.B[j][i]), bound);
    product[i][i] = 1.0;
  }
  const auto multiply = [](const double (&a)[M][M], const double (&b)[M][M], double (&out)[M][M]) {
    double sum[M][M] = {};
    for (int i = kFirst; i < M; ++i)
      for (int j = kFirst; j < M; ++j)
        for (int k = kFirst; k < M; ++k) sum[i][j] = fma_(a[i][k], b[k][j], sum[i][j]);
    for (int i = 0; i < M; ++i)
      for (int j = 0; j < M; ++j) out[i][j] = sum[i][j];
  };
  for (int squaring = 0; squaring < 4; ++squaring) {
    multiply(product, power, product);
    multiply(power, power, power);
  }
  for (int i = kFirst; i < M; ++i)
    for (int j = kFirst; j < M; ++j) to.B[i][j] = fma_(by, product[i][j], to.B[i][j]);
}

/// LoneCone::measure() in reverse: what the loss says of step lengths becomes what it says of the block.
template <int M>
STICTION_HD void pull_measures(const LoneCone<M>& s, LoneConeBar<M>& to) {
  const double n = s.inv_n[0], t = s.inv_t[0];
  if constexpr (M > 1) {
    double coupling = 0.0;
    for (int k = 1; k < M; ++k) {
      const double entry = 0.5 * (s.B[0][k] + s.B[k][0]);
      coupling = fma_(entry, entry, coupling);
    }
    const double rho = sqrt_((coupling * n) * t), by_rho = 0.0 - s.damping[0] * s.damping[0] * to.damping;
    if (rho > 0.0) {
      const double half = div_(0.5 * by_rho, rho);
      for (int k = 1; k < M; ++k) {
        const double by_entry = (half * n) * (t * (0.5 * (s.B[0][k] + s.B[k][0])));
        to.B[0][k] = to.B[0][k] + by_entry;
        to.B[k][0] = to.B[k][0] + by_entry;
      }
      to.inv_n = fma_(half * coupling, t, to.inv_n);
      to.inv_t = fma_(half * coupling, n, to.inv_t);
    }
    const double sum = n + t;
    if (sum > 0.0) {
      to.inv_n = to.inv_n + div_(div_(to.share * t, sum), sum);
      to.inv_t = to.inv_t - div_(div_(to.share * n, sum), sum);
    }
    const double by_bound = 0.0 - (t * t) * to.inv_t;
    const double whole = largest_eigenvalue_bound<M, 0>(s, 0), tangential = largest_eigenvalue_bound<M, 1>(s, 0);
    const auto smallest = static_cast<double>(kSmallestTangential);
    if (tangential > whole * smallest) {
      pull_eigenvalue_bound<M, 1>(s, by_bound, to);
    } else {
      pull_eigenvalue_bound<M, 0>(s, by_bound * smallest, to);
    }
  }
  to.B[0][0] = fma_(0.0 - n * n, to.inv_n, to.B[0][0]);
}

}  // namespace stiction::inline STICTION_ISA
