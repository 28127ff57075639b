#pragma once

#include "core/algorithm/linear/krylov/bicgstab.hpp"
#include "core/algorithm/velocity/blocks/load_blocks.hpp"

namespace stiction::inline STICTION_ISA {

/// The first step of a new problem, whose weights, centres and shifts are others. It takes the problem as it would be
/// if no cone changed how it is held, sliding or open (docs/math/velocity_newton.md, "In blocks"). All that moves is
/// linear then.
struct BlockRenewal {
  const BlockTerms& terms;
  double least;       ///< the new weight: compliance that is missing to this share of A's diagonal
  bool has_slip;      ///< de Saxce's terms are part of the motion
  bool slip_follows;  ///< and change with the velocities within the step: it is one of Newton's method on Coulomb's law

  /// New weights, centre and shift of a cone, and how its reactions answer to them alone.
  STICTION_HD void change_cone(Index c) const {
    const BlockWorkspace& n = terms.n;
    const Index first = terms.cones().row[c], count = terms.cones().rows(c);
    const double old[2] = {n.law[3 * c], n.law[3 * c + 1]};
    const bool sticks = count > 1 && n.G_cones[3 * c + 1] == 0.0 && n.G_rows[first] > 0.0;
    double slip = 0.0;
    for (Index row = first; row < first + count; ++row) {
      n.motion[row] = n.z[row] - n.shift[row];
      n.prox_center[row] = n.x[row];
      n.sigma[row] = 0.0;
      if (row == first || sticks || !has_slip) continue;
      n.sigma[row] = n.mu[row] * fma_(n.R[row], n.x[row], n.motion[row]);
      slip = fma_(n.sigma[row], n.sigma[row], slip);
    }
    slip = sqrt_(slip);
    set_compliances(terms, c, least);
    const double ratio[2] = {div_(old[0], n.law[3 * c]), count > 1 ? div_(old[1], n.law[3 * c + 1]) : 1.0};
    keep_zone(c, ratio[1]);
    double change[kMaxConeRows] = {}, answer[kMaxConeRows] = {};
    for (Index k = 0, row = first; k < count; ++k, ++row) {
      n.shift[row] = (k == 0 ? slip : 0.0) - n.prox[row] * n.prox_center[row];
      const double z = n.motion[row] + n.shift[row];
      change[k] = fma_(0.0 - ratio[k == 0 ? 0 : 1], n.z[row], z);
      n.z[row] = z;
      n.sigma[row] = slip_follows && slip > 0.0 ? n.mu[row] * div_(n.sigma[row], slip) : 0.0;
    }
    find_feedback(c);
    divide_by_slip(c, change);
    terms.times_hessian(c, change, answer);
    for (Index k = 0; k < count; ++k) n.x[first + k] = n.x[first + k] - answer[k];
  }

  /// M + J'WJ with W of cones whose slip follows; not symmetric. One lane makes a row.
  template <Team TeamT>
  STICTION_HD_OUTLINE void assemble(TeamT& team, const MassBlocks& mass, const BlockMatrix& S) const {
    const ConeTouches& cones = terms.cones();
    for_each(team, S.pattern.rows, [&](Index row) {
      for (Index k = S.pattern.offsets[row]; k < S.pattern.offsets[row + 1]; ++k)
        mass.load_entry(row, S.pattern.columns[k], S.block(k));
      for (Index e = cones.of_begin[row]; e < cones.of_begin[row + 1]; ++e) add_touch(cones.of_block[e], S);
    });
  }

  /// Moves motion and shift of a cone along the step p. n.Jp becomes J p.
  STICTION_HD void follow_cone(Index c) const {
    const BlockWorkspace& n = terms.n;
    const Index first = terms.cones().row[c], count = terms.cones().rows(c);
    double Jp[kMaxConeRows] = {}, change[kMaxConeRows] = {}, answer[kMaxConeRows] = {};
    terms.times_cone(c, n.step, Jp);
    double along = 0.0;
    bool turns = false;
    for (Index k = 0, row = first; k < count; ++k, ++row) {
      change[k] = Jp[k];
      along = fma_(n.sigma[row], Jp[k], along);
      turns = turns || n.sigma[row] != 0.0;
      n.z[row] = n.z[row] + Jp[k];
    }
    if (!turns) return;
    change[0] = change[0] + along;
    divide_by_slip(c, change);
    terms.times_hessian(c, change, answer);
    double slip = 0.0;
    for (Index k = 1, row = first + 1; k < count; ++k, ++row) {
      const double w = n.mu[row] * fma_(n.R[row], n.x[row] - answer[k], n.motion[row] + Jp[k]);
      slip = fma_(w, w, slip);
    }
    const double shift = sqrt_(slip) - n.prox[first] * n.prox_center[first];
    n.z[first] = n.z[first] + (shift - n.shift[first]);
    n.shift[first] = shift;
  }

 private:
  /// The slopes of a cone that stays as it was, with its new compliances. A sliding one keeps its reaction.
  STICTION_HD void keep_zone(Index c, double ratio) const {
    const BlockWorkspace& n = terms.n;
    const Index first = terms.cones().row[c];
    if (!(n.G_rows[first] > 0.0)) return;
    const bool slides = terms.cones().rows(c) > 1 && n.G_cones[3 * c + 1] > 0.0;
    n.G_rows[first] = n.law[3 * c + (slides ? 2 : 0)];
    if (terms.cones().rows(c) == 1) return;
    n.G_cones[3 * c] = slides ? div_(n.G_cones[3 * c], ratio) : n.law[3 * c + 1];
    n.G_cones[3 * c + 1] = slides ? n.law[3 * c + 2] : 0.0;
    n.G_cones[3 * c + 2] = slides ? n.law[3 * c + 2] - n.G_cones[3 * c] : 0.0;
  }

  /// feedback = G (R sigma): how the slip answers to the motion through reactions.
  STICTION_HD void find_feedback(Index c) const {
    const BlockWorkspace& n = terms.n;
    const Index first = terms.cones().row[c], count = terms.cones().rows(c);
    double in[kMaxConeRows] = {}, out[kMaxConeRows] = {};
    for (Index k = 0; k < count; ++k) in[k] = n.R[first + k] * n.sigma[first + k];
    terms.times_hessian(c, in, out);
    for (Index k = 0; k < count; ++k) n.feedback[first + k] = out[k];
  }

  /// change = (1 + e r')^-1 change, r the feedback and e the normal row.
  STICTION_HD void divide_by_slip(Index c, double (&change)[kMaxConeRows]) const {
    const double* const r = terms.n.feedback + terms.cones().row[c];
    double along = 0.0;
    for (Index k = 0; k < terms.cones().rows(c); ++k) along = fma_(r[k], change[k], along);
    change[0] = change[0] - div_(along, 1.0 + r[0]);
  }

  /// S = S + J'WJ of one touch with all of its cone. W' v = (1 + sigma e') (1 + r e')^-1 G v.
  STICTION_HD void add_touch(Index t, const BlockMatrix& S) const {
    const BlockWorkspace& n = terms.n;
    const ConeTouches& cones = terms.cones();
    const Index c = cones.cone[t], count = cones.rows(c), first = cones.row[c];
    const double* const J = n.J + cones.entry[t];
    double turned[kBodyBlock][kMaxConeRows];
    for (Index i = 0; i < kBodyBlock; ++i) {
      double column[kMaxConeRows] = {};
      for (Index k = 0; k < count; ++k) column[k] = J[k * kBodyBlock + i];
      terms.times_hessian(c, column, turned[i]);
      const double normal = div_(turned[i][0], 1.0 + n.feedback[first]);
      for (Index k = 0; k < count; ++k) turned[i][k] = fma_(0.0 - n.feedback[first + k], normal, turned[i][k]);
      for (Index k = 0; k < count; ++k) turned[i][k] = fma_(n.sigma[first + k], normal, turned[i][k]);
    }
    for (Index other = cones.begin[c]; other < cones.begin[c + 1]; ++other)
      terms.add_block(turned, count, other, S.block(find_block(S.pattern, cones.block[t], cones.block[other])));
  }
};

}  // namespace stiction::inline STICTION_ISA
