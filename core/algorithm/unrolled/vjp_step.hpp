#pragma once

#include "core/algorithm/unrolled/step_lengths.hpp"

/// A cone's step of a sweep in reverse (docs/math/derivative.md, (28) to (31)).
namespace stiction::inline STICTION_ISA {

/// Friction under Coulomb's law, in reverse: `bar` by the reaction after the step.
template <class Axes, int M>
STICTION_HD void coulomb_step_vjp(const Axes& axes, const LoneCone<M>& s, const double (&y)[M], double omega,
                                  const double (&bar)[M], LoneConeBar<M>& to) {
  const double pressed = fma_(0.0 - omega * axes.length[0], y[0], s.x[0]);
  const double fresh = pressed > 0.0 ? pressed : 0.0, moved = fresh - s.x[0];
  StepLengthBar<M> by;
  double z[M], motion[M], by_z[M];
  z[0] = fresh;
  for (int k = 1; k < M; ++k) {
    motion[k] = fma_(s.B[k][0], moved, y[k]);
    z[k] = fma_(0.0 - omega * axes.length[k], motion[k], s.x[k]);
    by_z[k] = bar[k];
  }
  double by_fresh = bar[0] + axes.disk_vjp(z, fresh, by_z, by), by_moved = 0.0;
  for (int k = 1; k < M; ++k) {
    const double by_motion = 0.0 - omega * axes.length[k] * by_z[k];
    to.x[k] = to.x[k] + by_z[k];
    to.y[k] = to.y[k] + by_motion;
    by.length[k] = fma_(0.0 - omega * motion[k], by_z[k], by.length[k]);
    to.B[k][0] = fma_(moved, by_motion, to.B[k][0]);
    by_moved = fma_(s.B[k][0], by_motion, by_moved);
  }
  by_fresh = by_fresh + by_moved;
  to.x[0] = to.x[0] - by_moved;
  if (pressed > 0.0) {
    to.x[0] = to.x[0] + by_fresh;
    to.y[0] = fma_(0.0 - omega * axes.length[0], by_fresh, to.y[0]);
    by.length[0] = fma_(0.0 - omega * y[0], by_fresh, by.length[0]);
  }
  axes.lengths_vjp(s, by, to);
}

/// Friction under the convex law, in reverse: both passes.
template <class Axes, int M>
STICTION_HD void convex_step_vjp(const Axes& axes, const LoneCone<M>& s, const double (&y)[M], double omega,
                                 const double (&bar)[M], LoneConeBar<M>& to) {
  const double damped = 0.0 - omega * axes.damping;
  StepLengthBar<M> by;
  double z[2][M], motion[2][M], first[M], by_point[M];
  for (int k = 0; k < M; ++k) {
    motion[0][k] = y[k];
    first[k] = z[0][k] = fma_(damped * axes.length[k], y[k], s.x[k]);
  }
  axes.project_cone(first);
  for (int i = 0; i < M; ++i) {
    motion[1][i] = y[i];
    for (int j = 0; j < M; ++j) motion[1][i] = fma_(s.B[i][j], first[j] - s.x[j], motion[1][i]);
    z[1][i] = fma_(damped * axes.length[i], motion[1][i], first[i]);
    by_point[i] = bar[i];
  }
  const auto pass_vjp = [&](int pass, double (&by_motion)[M]) {
    axes.cone_vjp(z[pass], by_point, by);
    for (int k = 0; k < M; ++k) {
      const double through = motion[pass][k] * by_point[k];
      by_motion[k] = damped * axes.length[k] * by_point[k];
      by.length[k] = fma_(damped, through, by.length[k]);
      by.damping = fma_(0.0 - omega * axes.length[k], through, by.damping);
    }
  };
  double by_motion[M];
  pass_vjp(1, by_motion);
  for (int i = 0; i < M; ++i) {
    to.y[i] = to.y[i] + by_motion[i];
    for (int j = 0; j < M; ++j) {
      const double through = s.B[i][j] * by_motion[i];
      by_point[j] = by_point[j] + through;
      to.x[j] = to.x[j] - through;
      to.B[i][j] = fma_(by_motion[i], first[j] - s.x[j], to.B[i][j]);
    }
  }
  pass_vjp(0, by_motion);
  for (int k = 0; k < M; ++k) {
    to.y[k] = to.y[k] + by_motion[k];
    to.x[k] = to.x[k] + by_point[k];
  }
  axes.lengths_vjp(s, by, to);
}

/// Friction under either law, in reverse, with the step lengths that FrictionConeStep takes.
template <Law kLaw, int M>
STICTION_HD void friction_step_vjp(const LoneCone<M>& s, const double (&y)[M], double omega, const double (&bar)[M],
                                   LoneConeBar<M>& to) {
  const auto pull = [&](const auto& axes) {
    if constexpr (kLaw == Law::coulomb) {
      coulomb_step_vjp(axes, s, y, omega, bar, to);
    } else {
      convex_step_vjp(axes, s, y, omega, bar, to);
    }
  };
  if constexpr (M > 2) {
    if (is_uneven<M>(s, 0)) {
      pull(UnevenAxes<M>(s));
      return;
    }
  }
  pull(EvenAxes<M>(s));
}

/// The step of any cone in reverse. Adds to `to` the cotangents of the cone before a step, by `bar` of the reaction.
template <Law kLaw, class Shape>
STICTION_HD void local_step_vjp(Shape, const LoneCone<Shape::kRows>& s, const double (&y)[Shape::kRows], double omega,
                                const double (&bar)[Shape::kRows], LoneConeBar<Shape::kRows>& to) {
  if constexpr (Shape::kKind == ConeKind::friction) {
    friction_step_vjp<kLaw>(s, y, omega, bar, to);
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
STICTION_HD void eigenvalue_bound_vjp(const LoneCone<M>& s, double by, LoneConeBar<M>& to) {
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

/// LoneCone::measure() in reverse: cotangents of step lengths become those of the block.
template <int M>
STICTION_HD void measures_vjp(const LoneCone<M>& s, LoneConeBar<M>& to) {
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
      eigenvalue_bound_vjp<M, 1>(s, by_bound, to);
    } else {
      eigenvalue_bound_vjp<M, 0>(s, by_bound * smallest, to);
    }
  }
  to.B[0][0] = fma_(0.0 - n * n, to.inv_n, to.B[0][0]);
}

}  // namespace stiction::inline STICTION_ISA
