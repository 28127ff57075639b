#pragma once

#include "core/algorithm/linear/line_search.hpp"
#include "core/algorithm/newton/cone_response.hpp"
#include "core/algorithm/velocity/blocks/block_workspace.hpp"

namespace stiction::inline STICTION_ISA {

/// The pieces of an iteration on one environment in blocks: reactions, gradient, Hessian, and the function along a line
/// (docs/math/velocity_newton.md). A cone is one lane's work, and so is a block of degrees of freedom.
struct BlockTerms {
  const BlockLists& lists;
  const BlockWorkspace& n;
  Index rows;

  [[nodiscard]] STICTION_HD const ConeTouches& cones() const { return lists.touches; }
  [[nodiscard]] STICTION_HD Index unknowns() const { return lists.dofs.unknowns(); }
  [[nodiscard]] STICTION_HD double length_of(const double (&z)[kMaxConeRows], Index count) const {
    double square = 0.0;
    for (Index k = 1; k < count; ++k) square = fma_(z[k], z[k], square);
    return sqrt_(square);
  }
  [[nodiscard]] STICTION_HD RowLaw<double> row_law(Index c) const {
    return {n.law[3 * c], n.law[3 * c + 1], n.law[3 * c + 2]};
  }
  [[nodiscard]] STICTION_HD ConeLaw<double> cone_law(Index c) const {
    return {n.law[3 * c], n.law[3 * c + 1], n.law[3 * c + 2]};
  }

  /// images = J vector for the rows of a cone, in the order of its touches.
  STICTION_HD void times_cone(Index c, const double* vector, double (&images)[kMaxConeRows]) const {
    const Index count = cones().rows(c);
    for (Index k = 0; k < count; ++k) images[k] = 0.0;
    for (Index t = cones().begin[c]; t < cones().begin[c + 1]; ++t) {
      const double* const v = vector + static_cast<Offset>(cones().block[t]) * kBodyBlock;
      const double* const J = n.J + cones().entry[t];
      for (Index k = 0; k < count; ++k)
        for (Index i = 0; i < kBodyBlock; ++i) images[k] = fma_(J[k * kBodyBlock + i], v[i], images[k]);
    }
  }

  /// sum = sum + J' vector for the unknowns of a block, in the order of cones.
  STICTION_HD void add_pushes(Index block, const double* vector, double (&sum)[kBodyBlock]) const {
    for (Index e = cones().of_begin[block]; e < cones().of_begin[block + 1]; ++e) {
      const Index t = cones().of_block[e], c = cones().cone[t];
      const double* const J = n.J + cones().entry[t];
      const double* const x = vector + cones().row[c];
      for (Index k = 0; k < cones().rows(c); ++k)
        for (Index i = 0; i < kBodyBlock; ++i) sum[i] = fma_(J[k * kBodyBlock + i], x[k], sum[i]);
    }
  }

  /// z at the point.
  template <Team TeamT>
  STICTION_HD_OUTLINE void refresh_motion(TeamT& team) const {
    for_each(team, cones().cones, [&](Index c) {
      double images[kMaxConeRows] = {};
      times_cone(c, n.point, images);
      for (Index k = 0, row = cones().row[c]; row < cones().row[c + 1]; ++k, ++row)
        n.z[row] = (images[k] + n.b[row]) + n.shift[row];
    });
  }

  /// Reactions and their slopes at z.
  template <Team TeamT>
  STICTION_HD_OUTLINE void refresh_reactions(TeamT& team) const {
    for_each(team, cones().cones, [&](Index c) {
      const Index first = cones().row[c], count = cones().rows(c);
      if (count == 1) {
        const RowReaction<double> point = row_reaction(row_law(c), n.z[first]);
        n.x[first] = point.x;
        n.G_rows[first] = point.slope;
        return;
      }
      double z[kMaxConeRows] = {};
      for (Index k = 0; k < count; ++k) z[k] = n.mu[first + k] * n.z[first + k];
      const ConeReaction<double> point = cone_reaction(cone_law(c), z[0], length_of(z, count));
      n.x[first] = point.x_n;
      n.G_rows[first] = point.normal;
      for (Index k = 1; k < count; ++k) {
        const double minus = 0.0 - z[k];
        n.x[first + k] = n.mu[first + k] * (point.across * minus);
        n.G_rows[first + k] = minus * point.inverse_length;
      }
      n.G_cones[3 * c] = point.across;
      n.G_cones[3 * c + 1] = point.slide;
      n.G_cones[3 * c + 2] = point.bend;
    });
  }

  /// out = G in for the rows of a cone.
  STICTION_HD void times_hessian(Index c, const double (&in)[kMaxConeRows], double (&out)[kMaxConeRows]) const {
    const Index first = cones().row[c], count = cones().rows(c);
    if (count == 1) {
      out[0] = n.G_rows[first] * in[0];
      return;
    }
    const double across = n.G_cones[3 * c], slide = n.G_cones[3 * c + 1], bend = n.G_cones[3 * c + 2];
    double along = 0.0;
    double scaled[kMaxConeRows] = {};
    for (Index k = 1; k < count; ++k) {
      scaled[k] = n.mu[first + k] * in[k];
      along = fma_(n.G_rows[first + k], scaled[k], along);
    }
    out[0] = fma_(slide, along, n.G_rows[first] * in[0]);
    const double pull = fma_(slide, in[0], bend * along);
    for (Index k = 1; k < count; ++k) out[k] = n.mu[first + k] * fma_(pull, n.G_rows[first + k], across * scaled[k]);
  }

  /// force = J' x - M p, minus the gradient.
  template <Team TeamT>
  STICTION_HD_OUTLINE void refresh_force(TeamT& team, const MassBlocks& mass) const {
    mass.multiply(team, n.point, n.pushed);
    for_each(team, lists.dofs.count, [&](Index block) {
      double sum[kBodyBlock];
      const Offset first = static_cast<Offset>(block) * kBodyBlock;
      for (Index i = 0; i < kBodyBlock; ++i) sum[i] = 0.0 - n.pushed[first + i];
      add_pushes(block, n.x, sum);
      for (Index i = 0; i < kBodyBlock; ++i) n.force[first + i] = sum[i];
    });
  }

  /// H = M + J'GJ. One lane makes a row's lower half; the upper one is its mirror image.
  template <Team TeamT>
  STICTION_HD_OUTLINE void refresh_hessian(TeamT& team, const MassBlocks& mass, const BlockMatrix& H) const {
    const BlockPattern& pattern = H.pattern;
    for_each(team, pattern.rows, [&](Index row) {
      const Index diagonal = find_block(pattern, row, row);
      for (Index k = pattern.offsets[row]; k <= diagonal; ++k) mass.load_entry(row, pattern.columns[k], H.block(k));
      for (Index e = cones().of_begin[row]; e < cones().of_begin[row + 1]; ++e) add_touch(cones().of_block[e], H);
      double* const own = H.block(diagonal);
      for (Index i = 0; i < kBodyBlock; ++i)
        for (Index j = 0; j < i; ++j) own[j * kBodyBlock + i] = own[i * kBodyBlock + j];
    });
    for_each(team, pattern.rows, [&](Index row) {
      for (Index k = pattern.offsets[row + 1] - 1; pattern.columns[k] > row; --k) {
        const double* const lower = H.block(find_block(pattern, pattern.columns[k], row));
        for (Index i = 0; i < kBodyBlock; ++i)
          for (Index j = 0; j < kBodyBlock; ++j) H.block(k)[i * kBodyBlock + j] = lower[j * kBodyBlock + i];
      }
    });
  }

  /// block = block + left J of one touch; `left` has rows of a cone's `count` numbers.
  STICTION_HD void add_block(const double (&left)[kBodyBlock][kMaxConeRows], Index count, Index touch,
                             double* block) const {
    const double* const J = n.J + cones().entry[touch];
    for (Index i = 0; i < kBodyBlock; ++i)
      for (Index k = 0; k < count; ++k)
        for (Index j = 0; j < kBodyBlock; ++j)
          block[i * kBodyBlock + j] = fma_(left[i][k], J[k * kBodyBlock + j], block[i * kBodyBlock + j]);
  }

  /// Products along the step p: J p, G J p, with slope and curvature of the function along the line.
  struct Along {
    double slope;      ///< at its beginning
    double curvature;  ///< of the quadratic model
    double noise;      ///< rounding of a slope that is zero
  };
  template <Team TeamT>
  STICTION_HD_OUTLINE Along line_products(TeamT& team, const MassBlocks& mass) const {
    for_each(team, cones().cones, [&](Index c) {
      double Jp[kMaxConeRows] = {}, GJp[kMaxConeRows] = {};
      times_cone(c, n.step, Jp);
      times_hessian(c, Jp, GJp);
      double curve = 0.0;
      double size = 0.0;
      for (Index k = 0, row = cones().row[c]; row < cones().row[c + 1]; ++k, ++row) {
        n.Jp[row] = Jp[k];
        n.GJp[row] = GJp[k];
        curve = fma_(Jp[k], GJp[k], curve);
        size = fma_(abs_(Jp[k]), abs_(n.x[row]), size);
      }
      n.line_curve[c] = curve;
      n.line_slope[c] = size;
    });
    mass.multiply(team, n.step, n.pushed);
    const double slope = 0.0 - dot_product(team, unknowns(), n.force, n.step);
    const double own = dot_product(team, unknowns(), n.pushed, n.step);
    const double curvature = own + sum_values(team, n.line_curve, cones().cones);
    return {slope, curvature, 0x1p-50 * sum_values(team, n.line_slope, cones().cones)};
  }

  /// Slope and curvature at p + t d. Only the difference from the quadratic model is summed; it is zero where a cone
  /// stays as it was.
  template <Team TeamT>
  STICTION_HD_OUTLINE LinePoint point_on_line(TeamT& team, const Along& along, double t) const {
    for_each(team, cones().cones, [&](Index c) {
      const LinePoint rest = cones().rows(c) == 1 ? rest_of_row(c, t) : rest_of_cone(c, t);
      n.line_slope[c] = rest.slope;
      n.line_curve[c] = rest.curvature;
    });
    const double slope = sum_values(team, n.line_slope, cones().cones);
    const double curvature = sum_values(team, n.line_curve, cones().cones);
    return {fma_(t, along.curvature, along.slope) + slope, along.curvature + curvature};
  }

  /// Point and motion a step of length t further on.
  template <Team TeamT>
  STICTION_HD_OUTLINE void take_step(TeamT& team, double t) const {
    for_each(team, unknowns(), [&](Index i) { n.point[i] = fma_(t, n.step[i], n.point[i]); });
    for_each(team, rows, [&](Index row) { n.z[row] = fma_(t, n.Jp[row], n.z[row]); });
  }

  /// The function that is minimised, at the point: energy and the cones' potentials.
  template <Team TeamT>
  STICTION_HD_OUTLINE double value(TeamT& team, const MassBlocks& mass) const {
    mass.multiply(team, n.point, n.pushed);
    const double energy = 0.5 * dot_product(team, unknowns(), n.pushed, n.point);
    for_each(team, rows, [&](Index row) {
      n.Jp[row] = n.x[row] * (0.0 - fma_(0.5 * (n.R[row] + n.prox[row]), n.x[row], n.z[row]));
    });
    return energy + sum_values(team, n.Jp, rows);
  }

 private:
  /// H = H + J'GJ of one touch with those of its cone that are not after it.
  STICTION_HD void add_touch(Index t, const BlockMatrix& H) const {
    const Index c = cones().cone[t], count = cones().rows(c);
    const double* const J = n.J + cones().entry[t];
    double GJ[kBodyBlock][kMaxConeRows];
    for (Index i = 0; i < kBodyBlock; ++i) {
      double column[kMaxConeRows] = {};
      for (Index k = 0; k < count; ++k) column[k] = J[k * kBodyBlock + i];
      times_hessian(c, column, GJ[i]);
    }
    for (Index other = cones().begin[c]; other <= t; ++other)
      add_block(GJ, count, other, H.block(find_block(H.pattern, cones().block[t], cones().block[other])));
  }

  [[nodiscard]] STICTION_HD LinePoint rest_of_row(Index c, double t) const {
    const Index row = cones().row[c];
    const double Jp = n.Jp[row];
    const RowReaction<double> point = row_reaction(row_law(c), fma_(t, Jp, n.z[row]));
    const double change = (n.x[row] - point.x) - t * n.GJp[row];
    return {change * Jp, ((point.slope - n.G_rows[row]) * Jp) * Jp};
  }
  [[nodiscard]] STICTION_HD LinePoint rest_of_cone(Index c, double t) const {
    const Index first = cones().row[c], count = cones().rows(c);
    double z[kMaxConeRows] = {}, Jp[kMaxConeRows] = {};
    for (Index k = 0; k < count; ++k) {
      Jp[k] = n.mu[first + k] * n.Jp[first + k];
      z[k] = fma_(t, Jp[k], n.mu[first + k] * n.z[first + k]);
    }
    const ConeReaction<double> point = cone_reaction(cone_law(c), z[0], length_of(z, count));
    double along = 0.0;
    double square = 0.0;
    double slope = ((n.x[first] - point.x_n) - t * n.GJp[first]) * Jp[0];
    double before = n.GJp[first] * Jp[0];
    for (Index k = 1; k < count; ++k) {
      const double minus = 0.0 - z[k], raw = n.Jp[first + k];
      const double x = n.mu[first + k] * (point.across * minus);
      along = fma_(minus * point.inverse_length, Jp[k], along);
      square = fma_(Jp[k], Jp[k], square);
      slope = fma_((n.x[first + k] - x) - t * n.GJp[first + k], raw, slope);
      before = fma_(n.GJp[first + k], raw, before);
    }
    const double turned = fma_((2.0 * point.slide) * Jp[0], along, (point.normal * Jp[0]) * Jp[0]);
    const double after = fma_(point.bend * along, along, fma_(point.across, square, turned));
    return {slope, after - before};
  }
};

}  // namespace stiction::inline STICTION_ISA
