#pragma once

#include "core/algorithm/unrolled/lone_cone.hpp"

/// Step lengths of a cone's rows, even or uneven, and the projections in their metric, in reverse.
namespace stiction::inline STICTION_ISA {

/// Derivatives of a loss by the step lengths of a cone's rows.
template <int M>
struct StepLengthBar {
  double length[M] = {};
  double damping = 0.0, share = 0.0;
};

/// The transposed derivative of project_second_order_cone() at z, of `bar`; adds that by the share.
template <int M>
STICTION_HD void cone_projection_vjp(const double (&z)[M], double share, double (&bar)[M], double& by_share) {
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

/// One step length for all axes.
template <int M>
struct EvenAxes {
  double length[M];
  double damping, share;

  explicit STICTION_HD EvenAxes(const LoneCone<M>& s) : damping(s.damping[0]), share(s.share[0]) {
    for (int k = 0; k < M; ++k) length[k] = k == 0 ? s.inv_n[0] : s.inv_t[0];
  }

  /// project_disk() in reverse: changes `bar` by the point, returns that by the radius.
  STICTION_HD double disk_vjp(const double (&z)[M], double radius, double (&bar)[M], StepLengthBar<M>&) const {
    const double norm = tangential_norm<M>(z);
    if (norm <= radius) return 0.0;
    double along = 0.0;
    for (int k = 1; k < M; ++k) along = fma_(div_(z[k], norm), bar[k], along);
    for (int k = 1; k < M; ++k) bar[k] = div_(radius, norm) * (bar[k] - div_(z[k], norm) * along);
    return along;
  }

  STICTION_HD void project_cone(double (&z)[M]) const { project_second_order_cone<M>(z, share); }
  STICTION_HD void cone_vjp(const double (&z)[M], double (&bar)[M], StepLengthBar<M>& by) const {
    cone_projection_vjp<M>(z, share, bar, by.share);
  }

  STICTION_HD void lengths_vjp(const LoneCone<M>&, const StepLengthBar<M>& by, LoneConeBar<M>& to) const {
    to.inv_n = to.inv_n + by.length[0];
    for (int k = 1; k < M; ++k) to.inv_t = to.inv_t + by.length[k];
    to.damping = to.damping + by.damping;
    to.share = to.share + by.share;
  }
};

/// A step length for each axis, as uneven_friction.hpp has them. Projections are differentiated through the equation of
/// their root s.
template <int M>
struct UnevenAxes {
  UnevenCone<double, M> cone;
  double metric[M];
  double length[M];
  double stiffness, rho, damping;

  explicit STICTION_HD UnevenAxes(const LoneCone<M>& s) {
    for (int i = 0; i < M; ++i)
      for (int j = 0; j < M; ++j) cone.block[i][j] = s.B[i][j];
    cone.inv_n = length[0] = s.inv_n[0];
    cone.inv_t = s.inv_t[0];
    axis_metric(cone, metric);
    for (int k = 1; k < M; ++k) length[k] = div_(1.0, metric[k]);
    stiffness = cone.inv_n > 0.0 ? div_(1.0, cone.inv_n) : metric[1];
    rho = axis_coupling(cone, metric);
    damping = div_(1.0, 1.0 + rho);
  }

  /// project_disk_in() in reverse: changes `bar` by the point, returns that by the radius.
  STICTION_HD double disk_vjp(const double (&z)[M], double radius, double (&bar)[M], StepLengthBar<M>& by) const {
    if (tangential_norm<M>(z) <= radius) return 0.0;
    double out[M];
    for (int k = 0; k < M; ++k) out[k] = z[k];
    const double s = project_disk_in(out, metric, radius);
    if (!(radius > 0.0)) {
      for (int k = 1; k < M; ++k) bar[k] = 0.0;
      return 0.0;
    }
    double by_s = 0.0, slope = 0.0;
    for (int k = 1; k < M; ++k) {
      const double shrunk = div_(out[k] * length[k], fma_(s, length[k], 1.0));
      by_s = fma_(0.0 - bar[k], shrunk, by_s);
      slope = fma_(out[k], shrunk, slope);
    }
    const double pull = slope > 0.0 ? div_(by_s, slope) : 0.0;
    for (int k = 1; k < M; ++k) {
      const double through = div_(fma_(pull, out[k], bar[k]), fma_(s, length[k], 1.0));
      by.length[k] = fma_(0.0 - s * out[k], through, by.length[k]);
      bar[k] = through;
    }
    return 0.0 - pull * radius;
  }

  STICTION_HD void project_cone(double (&z)[M]) const { project_cone_in(z, stiffness, metric); }

  /// project_cone_in() in reverse.
  STICTION_HD void cone_vjp(const double (&z)[M], double (&bar)[M], StepLengthBar<M>& by) const {
    if (tangential_norm<M>(z) <= z[0]) return;
    double out[M];
    for (int k = 0; k < M; ++k) out[k] = z[k];
    const double s = project_cone_in(out, stiffness, metric);
    const bool is_polar = !(out[0] > 0.0);
    double by_s = 0.0, slope = 0.0;
    for (int k = 1; k < M && !is_polar; ++k) {
      const double g = stiffness * length[k], shrunk = div_(out[k], fma_(s, g, 1.0));
      bar[k] = fma_(div_(out[k], out[0]), bar[0], bar[k]);
      by_s = fma_(0.0 - bar[k], shrunk * g, by_s);
      slope = fma_(div_(out[k], out[0]), fma_(shrunk, g, shrunk), slope);
    }
    const double pull = is_polar ? 0.0 : div_(by_s, slope);
    bar[0] = 0.0 - pull;
    double by_stiffness = 0.0;
    for (int k = 1; k < M; ++k) {
      if (is_polar) {
        bar[k] = 0.0;
        continue;
      }
      bar[k] = div_(fma_(pull * (1.0 - s), div_(out[k], out[0]), bar[k]), fma_(s, stiffness * length[k], 1.0));
      const double by_g = 0.0 - s * out[k] * bar[k];
      by.length[k] = fma_(stiffness, by_g, by.length[k]);
      by_stiffness = fma_(length[k], by_g, by_stiffness);
    }
    double& own = by.length[cone.inv_n > 0.0 ? 0 : 1];
    own = fma_(0.0 - stiffness * stiffness, by_stiffness, own);
  }

  /// axis_metric() and axis_coupling() in reverse: cotangents of step lengths become those of the
  /// block.
  STICTION_HD void lengths_vjp(const LoneCone<M>& s, StepLengthBar<M> by, LoneConeBar<M>& to) const {
    const auto entry = [&](int i, int j) { return 0.5 * (s.B[i][j] + s.B[j][i]); };
    const auto add = [&](int i, int j, double by_entry) {
      to.B[i][j] = fma_(0.5, by_entry, to.B[i][j]);
      to.B[j][i] = fma_(0.5, by_entry, to.B[j][i]);
    };
    if (rho > 0.0) {
      const double by_square = div_(0.0 - 0.5 * damping * damping * by.damping, rho);
      for (int k = 1; k < M; ++k) {
        const double e = entry(0, k);
        add(0, k, 2.0 * by_square * e * (length[k] * length[0]));
        by.length[k] = fma_(by_square, e * e * length[0], by.length[k]);
        by.length[0] = fma_(by_square, e * e * length[k], by.length[0]);
      }
    }
    to.inv_n = to.inv_n + by.length[0];
    // metric = bound * diagonal, and the bound is the largest row's sum of entries relative to their diagonals.
    double bound = 1.0, by_bound = 0.0;
    int row = 0;
    const auto relative = [&](int i, int j) {
      const double scale = s.B[i][i] * s.B[j][j];
      return scale > 0.0 ? div_(entry(i, j), sqrt_(scale)) : 0.0;
    };
    for (int i = 1; i < M; ++i) {
      double sum = 0.0;
      for (int j = 1; j < M; ++j) sum = sum + abs_(relative(i, j));
      if (sum > bound) {
        bound = sum;
        row = i;
      }
    }
    for (int k = 1; k < M; ++k) {
      if (!(s.B[k][k] > 0.0)) {
        to.inv_t = to.inv_t + by.length[k];
        continue;
      }
      const double by_metric = 0.0 - length[k] * length[k] * by.length[k];
      to.B[k][k] = fma_(bound, by_metric, to.B[k][k]);
      by_bound = fma_(s.B[k][k], by_metric, by_bound);
    }
    if (row == 0) return;
    for (int j = 1; j < M; ++j) {
      const double part = abs_(relative(row, j));
      if (j == row || part == 0.0) continue;
      add(row, j, div_(by_bound * part, entry(row, j)));
      to.B[row][row] = to.B[row][row] - div_(0.5 * by_bound * part, s.B[row][row]);
      to.B[j][j] = to.B[j][j] - div_(0.5 * by_bound * part, s.B[j][j]);
    }
  }
};

}  // namespace stiction::inline STICTION_ISA
