#pragma once

#include "core/algorithm/problem/cone_projection.hpp"

/// Steps of friction cones whose axes differ: each axis steps with its own length, and the projection is the one in
/// that metric. With the Euclidean one the fixed point would not obey the law.
namespace stiction::inline STICTION_ISA {

/// From this ratio of the largest to the smallest diagonal of the tangential rows on a cone is uneven.
inline constexpr float kUneven = 4.0F;

/// Steps to a root at most. Each lane stops by itself, as soon as a step no longer moves it.
inline constexpr int kSecularSteps = 48;

/// Data of an uneven cone that a visit reads.
template <class Real, int M>
struct UnevenCone {
  Real x[M];
  Real y[M];
  Real block[M][M];
  Real inv_n;
  Real inv_t;  ///< the metric of rows that do not move
  Real omega;
};

/// The lanes whose cone is uneven. Rows with nothing on the diagonal do not count.
template <int M, class System>
STICTION_HD auto is_uneven(const System& s, Index row) {
  using Real = typename System::Real;
  Real least = s.block_entry(row, 1, 1);
  Real most = least;
  for (int k = 2; k < M; ++k) {
    const Real diagonal = s.block_entry(row, k, k);
    least = select(and_(diagonal > Real(0), or_(diagonal < least, not_(least > Real(0)))), diagonal, least);
    most = max_(diagonal, most);
  }
  return and_(least > Real(0), Real(kUneven) * least < most);
}

/// The metric of the tangential rows: their diagonal times the largest row sum of the block relative to it.
template <class Real, int M>
STICTION_HD void axis_metric(const UnevenCone<Real, M>& cone, Real (&metric)[M]) {
  Real inverse[M];
  for (int k = 1; k < M; ++k) {
    const Real diagonal = cone.block[k][k];
    inverse[k] = select(diagonal > Real(0), div_(Real(1), sqrt_(diagonal)), Real(0));
  }
  Real bound(1);
  for (int k = 1; k < M; ++k) {
    Real sum(0);
    for (int j = 1; j < M; ++j) {
      const Real entry = Real(0.5) * (cone.block[k][j] + cone.block[j][k]);
      sum = fma_(abs_(entry) * inverse[k], inverse[j], sum);
    }
    bound = max_(sum, bound);
  }
  const Real still = div_(Real(1), cone.inv_t);
  for (int k = 1; k < M; ++k) metric[k] = select(cone.block[k][k] > Real(0), bound * cone.block[k][k], still);
}

/// 1 / norm(z_t) with z_k = p_k / (1 + s g_k), and its derivative. Concave in s (More and Sorensen 1983).
template <class Real, int M>
STICTION_HD void inverse_length(const Real (&p)[M], const Real (&g)[M], Real s, Real& value, Real& slope) {
  Real square(0);
  Real steep(0);
  for (int k = 1; k < M; ++k) {
    const Real shrink = div_(Real(1), fma_(s, g[k], Real(1)));
    const Real z = p[k] * shrink;
    square = fma_(z, z, square);
    steep = fma_(z * z, g[k] * shrink, steep);
  }
  value = div_(Real(1), sqrt_(square));
  slope = steep * value * value * value;
}

/// The root of height / norm(z_t(s)) + tilt s - target = 0 by Newton's steps from s, in the lanes of `active`. The
/// function is concave or convex, and s lies where Newton's steps are monotone: upwards, or downwards in the lanes of
/// `falls`.
template <class Real, int M>
STICTION_HD Real secular_root(const Real (&p)[M], const Real (&g)[M], Real height, Real tilt, Real target, Real s,
                              Mask<Real> active, Mask<Real> falls) {
  for (int step = 0; step < kSecularSteps && any(active); ++step) {
    Real value;
    Real slope;
    inverse_length(p, g, s, value, slope);
    const Real gap = fma_(height, value, fma_(tilt, s, Real(0) - target));
    const Real next = s - div_(gap, fma_(height, slope, tilt));
    const auto moves = or_(and_(falls, next < s), and_(not_(falls), next > s));
    active = and_(active, and_(moves, next > Real(0)));
    s = select(active, next, s);
  }
  return s;
}

/// z's tangential part onto the disk of the given radius >= 0 in the metric: z_k / (1 + s / metric_k). Returns s, zero
/// inside.
template <class Real, int M>
STICTION_HD Real project_disk_in(Real (&z)[M], const Real (&metric)[M], Real radius) {
  Real least = metric[1];
  Real most = abs_(z[1]);
  for (int k = 2; k < M; ++k) {
    least = min_(metric[k], least);
    most = max_(abs_(z[k]), most);
  }
  Real p[M];
  Real g[M];
  const Real unit = select(most > Real(0), div_(Real(1), most), Real(0));
  for (int k = 1; k < M; ++k) {
    p[k] = z[k] * unit;
    g[k] = div_(least, metric[k]);
  }
  const auto outside = and_(not_(tangential_norm<M>(z) <= radius), radius > Real(0));
  const Real s = secular_root(p, g, Real(1), Real(0), div_(most, radius), Real(0), outside, not_(outside));
  for (int k = 1; k < M; ++k) z[k] = select(outside, div_(z[k], fma_(s, g[k], Real(1))), z[k]);
  // Rounding, and a radius of zero.
  project_disk<M>(z, radius);
  return select(outside, s * least, Real(0));
}

/// coulomb_step() of an uneven cone.
template <class Real, int M>
STICTION_HD_SHARED void uneven_coulomb_step(const UnevenCone<Real, M>& cone, Real (&d)[M]) {
  Real metric[M];
  axis_metric(cone, metric);
  Real z[M];
  z[0] = project_half_line(fma_(Real(0) - cone.omega * cone.inv_n, cone.y[0], cone.x[0]));
  d[0] = z[0] - cone.x[0];
  for (int k = 1; k < M; ++k) {
    const Real motion = fma_(cone.block[k][0], d[0], cone.y[k]);
    z[k] = cone.x[k] - div_(cone.omega * motion, metric[k]);
  }
  project_disk_in(z, metric, z[0]);
  for (int k = 1; k < M; ++k) d[k] = z[k] - cone.x[k];
}

/// z onto the unit second-order cone in the metric diag(normal, metric_1, ...). With t = norm of the answer's tangent
/// it is z_k / (1 + s g_k) and z_n + s t, g_k = normal / metric_k. s is the root of z_n / t(s) - 1 + s, below 1 where
/// z_n > 0 and above it where z_n < 0. Returns s, which means nothing in the cone and in its polar.
template <class Real, int M>
STICTION_HD Real project_cone_in(Real (&z)[M], Real normal, const Real (&metric)[M]) {
  Real g[M];
  Real p[M];
  Real most = abs_(z[0]);
  for (int k = 1; k < M; ++k) most = max_(abs_(z[k]), most);
  const Real unit = select(most > Real(0), div_(Real(1), most), Real(0));
  // Norms of p_t / g: the polar cone, and a bound of the root from above.
  Real square(0);
  Real least_g(0);
  for (int k = 1; k < M; ++k) {
    p[k] = z[k] * unit;
    g[k] = div_(normal, metric[k]);
    const Real force = div_(p[k], g[k]);
    square = fma_(force, force, square);
    least_g = k == 1 ? g[k] : min_(g[k], least_g);
  }
  p[0] = z[0] * unit;
  const Real length = tangential_norm<M>(p);
  const Real force = sqrt_(square);
  const auto inside = length <= p[0];
  const auto polar = and_(not_(inside), force <= Real(0) - p[0]);
  const auto between = and_(not_(inside), not_(polar));
  const auto falls = p[0] < Real(0);
  // 1 / t(s) <= (1 / least_g + s) / force, so that the root is at most where the function with that in it is zero.
  const Real pull = div_(Real(0) - p[0], force);
  const Real high = div_(Real(1) + div_(pull, least_g), Real(1) - pull);
  const Real s = secular_root(p, g, p[0], Real(1), Real(1), select(falls, high, Real(0)), between, falls);
  Real out[M];
  for (int k = 1; k < M; ++k) out[k] = div_(z[k], fma_(s, g[k], Real(1)));
  out[0] = tangential_norm<M>(out);
  for (int k = 0; k < M; ++k) z[k] = select(inside, z[k], select(between, out[k], Real(0)));
  return s;
}

/// norm(B_tn) relative to the metric of normal and axes: rho of docs/math/local_solve.md.
template <class Real, int M>
STICTION_HD Real axis_coupling(const UnevenCone<Real, M>& cone, const Real (&metric)[M]) {
  Real coupling(0);
  for (int k = 1; k < M; ++k) {
    const Real entry = Real(0.5) * (cone.block[0][k] + cone.block[k][0]);
    coupling = fma_(entry * div_(entry, metric[k]), cone.inv_n, coupling);
  }
  return sqrt_(coupling);
}

/// Proximal steps on the local problem of a cone under the convex law.
inline constexpr int kLocalSteps = 2;

/// convex_step() of an uneven cone.
template <class Real, int M>
STICTION_HD_SHARED void uneven_convex_step(const UnevenCone<Real, M>& cone, Real (&d)[M]) {
  Real metric[M];
  axis_metric(cone, metric);
  const Real stiffness = select(cone.inv_n > Real(0), div_(Real(1), cone.inv_n), metric[1]);
  const Real damped = div_(cone.omega, Real(1) + axis_coupling(cone, metric));
  Real motion[M];
  for (int k = 0; k < M; ++k) {
    d[k] = Real(0);
    motion[k] = cone.y[k];
  }
  for (int pass = 0; pass < kLocalSteps; ++pass) {
    Real z[M];
    z[0] = fma_(Real(0) - damped * cone.inv_n, motion[0], cone.x[0] + d[0]);
    for (int k = 1; k < M; ++k) z[k] = (cone.x[k] + d[k]) - div_(damped * motion[k], metric[k]);
    project_cone_in(z, stiffness, metric);
    Real change[M];
    for (int k = 0; k < M; ++k) {
      const Real next = z[k] - cone.x[k];
      change[k] = next - d[k];
      d[k] = next;
    }
    if (pass + 1 < kLocalSteps)
      for (int i = 0; i < M; ++i)
        for (int j = 0; j < M; ++j) motion[i] = fma_(cone.block[i][j], change[j], motion[i]);
  }
}

}  // namespace stiction::inline STICTION_ISA
