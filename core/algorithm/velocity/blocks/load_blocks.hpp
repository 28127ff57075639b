#pragma once

#include "core/algorithm/residual/final_residual.hpp"
#include "core/algorithm/velocity/blocks/block_terms.hpp"
#include "core/algorithm/velocity/evaluate/newton_progress.hpp"
#include "core/algorithm/velocity/load/load_pack.hpp"

/// From a batch's arrays to the numbers of one environment in blocks.
namespace stiction::inline STICTION_ISA {

/// 0 for a finite number, else NaN.
STICTION_HD double nothing_of(double number) {
  return number * 0.0;
}

/// J of one cone, by touch. Entries of a row that name a column twice add up.
template <class Real>
STICTION_HD bool load_cone(const JacobianBatchView<Real>& batch, const LaneEnv<Real>& env, const BlockLists& lists,
                           const BlockWorkspace& n, Index c) {
  const ConeTouches& touches = lists.touches;
  const Index first = touches.begin[c], end = touches.begin[c + 1], rows = touches.rows(c);
  for (Index t = first; t < end; ++t)
    for (Index i = 0; i < rows * kBodyBlock; ++i) n.J[touches.entry[t] + i] = 0.0;
  double nothing = 0.0;
  for (Index k = 0; k < rows; ++k) {
    const Offset from = batch.row_offsets[env.first_row + touches.row[c] + k];
    const Offset entries =
        batch.column == nullptr ? Offset{env.dofs} : batch.row_offsets[env.first_row + touches.row[c] + k + 1] - from;
    for (Offset e = 0; e < entries; ++e) {
      const Real number = batch.J[from + e];
      if (number == Real(0)) continue;
      const Index dof = batch.column == nullptr ? static_cast<Index>(e) : batch.column[from + e];
      const Index block = lists.dofs.of_dof[dof];
      Index t = first;
      while (touches.block[t] != block) ++t;
      double& entry = n.J[touches.entry[t] + k * kBodyBlock + (dof - lists.dofs.first_dof[block])];
      entry = entry + static_cast<double>(number);
      nothing = nothing + nothing_of(entry);
    }
  }
  return nothing == 0.0;
}

/// Data of a cone's rows beside J. Returns true if it may be computed with: finite, friction and compliance not
/// negative, bounds in order.
template <class Real>
STICTION_HD bool load_rows(const JacobianBatchView<Real>& batch, const LaneEnv<Real>& env, const BlockLists& lists,
                           const BlockWorkspace& n, Index c) {
  const ConeTouches& touches = lists.touches;
  bool is_sound = true;
  double nothing = 0.0;
  for (Index row = touches.row[c]; row < touches.row[c + 1]; ++row) {
    const Offset at = env.first_row + row;
    n.target[row] = batch.target == nullptr ? 0.0 : static_cast<double>(batch.target[at]);
    n.R[row] = static_cast<double>(batch.R[at]);
    n.mu[row] = row == touches.row[c] ? 1.0 : static_cast<double>(batch.mu[at]);
    n.prox[row] = n.prox_center[row] = n.shift[row] = 0.0;
    nothing = nothing + (nothing_of(n.target[row]) + (nothing_of(n.R[row]) + nothing_of(n.mu[row])));
    is_sound = is_sound && n.R[row] >= 0.0 && n.mu[row] >= 0.0;
  }
  if (touches.rows(c) == 1) {
    const Bounds<Real> bounds = bounds_of(batch, batch.cone_kind[env.first_cone + c], env.first_row + touches.row[c]);
    n.law[3 * c + 1] = static_cast<double>(bounds.lo);
    n.law[3 * c + 2] = static_cast<double>(bounds.hi);
    is_sound = is_sound && n.law[3 * c + 1] <= n.law[3 * c + 2];
  }
  return is_sound && nothing == 0.0;
}

/// All numbers of an environment but M. Returns true if they are sound, on every lane.
template <Team TeamT, class Real>
STICTION_HD_OUTLINE bool load_environment(TeamT& team, const JacobianBatchView<Real>& batch, const LaneEnv<Real>& env,
                                          const BlockLists& lists, const BlockWorkspace& n) {
  std::uint32_t broken = 0;
  for_each(team, lists.touches.cones, [&](Index c) {
    const bool has_J = load_cone(batch, env, lists, n, c);
    if (!load_rows(batch, env, lists, n, c) || !has_J) broken = 1;
  });
  for_each(team, lists.dofs.count, [&](Index block) {
    for (Index i = 0; i < kBodyBlock; ++i) {
      const Offset at = static_cast<Offset>(block) * kBodyBlock + i;
      const bool is_own = i < lists.dofs.size(block);
      n.v_free[at] = is_own ? static_cast<double>(env.v_free[lists.dofs.first_dof[block] + i]) : 0.0;
      n.point[at] = 0.0;
      if (nothing_of(n.v_free[at]) != 0.0) broken = 1;
    }
  });
  return team.combine(broken) == 0;
}

/// The diagonal of J M^-1 J' for a cone's rows. `path`: a lane's scratch of 6 kMostGroupBlocks.
STICTION_HD void find_diagonal(const BlockLists& lists, const MassBlocks& mass, const BlockWorkspace& n, Index c,
                               double* path) {
  const ConeTouches& touches = lists.touches;
  for (Index k = 0; k < touches.rows(c); ++k) {
    double sum = 0.0;
    for (Index t = touches.begin[c]; t < touches.begin[c + 1];) {
      // The touches of one group of M, from its first one's block to the group's end.
      const Index first = touches.block[t], of = lists.dofs.of_block[first];
      Index end = first + 1;
      while (end < lists.dofs.count && lists.dofs.of_block[end] == of) ++end;
      for (Index i = 0; i < (end - first) * kBodyBlock; ++i) path[i] = 0.0;
      for (; t < touches.begin[c + 1] && touches.block[t] < end; ++t)
        for (Index i = 0; i < kBodyBlock; ++i)
          path[(touches.block[t] - first) * kBodyBlock + i] = n.J[touches.entry[t] + k * kBodyBlock + i];
      mass.solve_down(first, end, path);
      for (Index i = 0; i < (end - first) * kBodyBlock; ++i) sum = fma_(path[i], path[i], sum);
    }
    n.diagonal[touches.row[c] + k] = sum;
  }
}

/// The metric of a cone in blocks.
template <class Shape>
STICTION_HD ConeMetric<double, Shape::kRows> block_cone_metric(Shape, const BlockTerms& terms, Index c) {
  const BlockWorkspace& n = terms.n;
  const Index first = terms.cones().row[c];
  ConeMetric<double, Shape::kRows> metric;
  metric.a = max_(n.diagonal[first] + n.R[first], 0.0);
  for (int k = 0; k < Shape::kRows; ++k) {
    metric.press[k] = n.axis_press[first + k];
    metric.slip[k] = n.axis_slip[first + k];
  }
  return metric;
}

/// Adds the error of a cone's reactions x, of which y is the motion. Rows between bounds are boxes, whatever their
/// kind: a free row has infinite ones.
STICTION_HD void add_block_cone(const BlockTerms& terms, Index c, Law law, const double* reaction, const double* motion,
                                double share, double unit, LargestResidual<double>& largest) {
  const BlockWorkspace& n = terms.n;
  const Index first = terms.cones().row[c];
  const auto add = [&](auto shape, auto of) {
    constexpr int kRows = decltype(shape)::kRows;
    double x[kRows];
    double y[kRows];
    for (int k = 0; k < kRows; ++k) {
      const double own = reaction == nullptr ? 0.0 : reaction[first + k];
      x[k] = k == 0 ? own : unit_reaction(own, n.mu[first + k]);
      y[k] = n.mu[first + k] * motion[first + k];
    }
    const double lo = kRows == 1 ? n.law[3 * c + 1] : 0.0, hi = kRows == 1 ? n.law[3 * c + 2] : 0.0;
    largest.template add<decltype(of)::value>(shape, x, y, block_cone_metric(shape, terms, c), lo, hi, share, unit);
  };
  if (terms.cones().rows(c) == 1) {
    add(ConeShape<ConeKind::box, 1>{}, LawConstant<Law::convex>{});
    return;
  }
  with_shape(ConeKind::friction, terms.cones().rows(c), [&](auto shape) {
    if constexpr (decltype(shape)::kKind == ConeKind::friction) {
      if (law == Law::coulomb) {
        add(shape, LawConstant<Law::coulomb>{});
      } else {
        add(shape, LawConstant<Law::convex>{});
      }
    }
  });
}

/// The error scale of a cone alone, from b. `unit`: ErrorScale's.
STICTION_HD double error_at_rest(const BlockTerms& terms, Index c, Law law, double unit) {
  const BlockWorkspace& n = terms.n;
  LargestResidual<double> own;
  add_block_cone(terms, c, law, nullptr, n.b, 1.0, unit, own);
  double largest = 0.0;
  for (Index row = terms.cones().row[c]; row < terms.cones().row[c + 1]; ++row) largest = max_(abs_(n.b[row]), largest);
  return max_(div_(sqrt_(own.square), unit), static_cast<double>(kIdleShare) * largest);
}

/// One pass of scales in n.share over degrees of freedom, whose own is in n.force, and along M. True if any changed.
STICTION_HD bool spread_scales(const BlockTerms& terms, const MassBlocks& mass) {
  const BlockWorkspace& n = terms.n;
  const ConeTouches& cones = terms.cones();
  const DofBlocks& dofs = terms.lists.dofs;
  double* const reach = n.force;
  const auto for_each_touched = [&](Index c, auto&& f) {
    for (Index t = cones.begin[c]; t < cones.begin[c + 1]; ++t)
      for (Index e = 0; e < cones.rows(c) * kBodyBlock; ++e)
        if (n.J[cones.entry[t] + e] != 0.0) f(cones.block[t] * kBodyBlock + e % kBodyBlock);
  };
  for (Index i = 0; i < dofs.unknowns(); ++i) reach[i] = 0.0;
  for (Index c = 0; c < cones.cones; ++c) for_each_touched(c, [&](Index i) { reach[i] = max_(n.share[c], reach[i]); });
  for (Index row = 0; row < dofs.count; ++row)
    for (Index column = dofs.of_block[row]; column <= row; ++column)
      for (Index e = 0; e < kBodyBlock * kBodyBlock; ++e) {
        if (mass.M[mass.at(row, column) + e] == 0.0) continue;
        double& a = reach[row * kBodyBlock + e / kBodyBlock];
        double& b = reach[column * kBodyBlock + e % kBodyBlock];
        a = b = max_(a, b);
      }
  bool has_changed = false;
  for (Index c = 0; c < cones.cones; ++c) {
    double found = n.share[c];
    for_each_touched(c, [&](Index i) { found = max_(reach[i], found); });
    has_changed = has_changed || found > n.share[c];
    n.share[c] = found;
  }
  return has_changed;
}

/// Error scales of islands: n.share becomes each cone's share of the largest, which is returned.
template <Team TeamT>
STICTION_HD_OUTLINE double weigh_islands(TeamT& team, const BlockTerms& terms, const MassBlocks& mass, Law law,
                                         double unit) {
  const BlockWorkspace& n = terms.n;
  const Index cones = terms.cones().cones;
  for_each(team, cones, [&](Index c) { n.share[c] = error_at_rest(terms, c, law, unit); });
  const double most = max_over<double>(team, cones, [&](Index c) { return n.share[c]; });
  single(team, [&] {
    bool differ = false;
    for (Index c = 0; c < cones; ++c) differ = differ || n.share[c] != most;
    while (differ) differ = spread_scales(terms, mass);
  });
  for_each(team, cones, [&](Index c) { n.share[c] = most > 0.0 ? island_share(most, n.share[c]) : 1.0; });
  return most;
}

/// b of a cone's rows, its metric and the weight of its steps. Returns whether its diagonal is positive.
STICTION_HD bool set_weight(const BlockTerms& terms, Index c) {
  const BlockWorkspace& n = terms.n;
  const Index first = terms.cones().row[c], count = terms.cones().rows(c);
  double b[kMaxConeRows] = {};
  double trace = 0.0;
  terms.times_cone(c, n.v_free, b);
  for (Index k = 0, row = first; k < count; ++k, ++row) {
    n.b[row] = b[k] - n.target[row];
    trace = trace + (n.diagonal[row] + n.R[row]);
  }
  n.weight[c] = residual_weight(div_(trace, static_cast<double>(count)));
  const double a = max_(n.diagonal[first] + n.R[first], 0.0);
  for (Index row = first; row < first + count; ++row) {
    const auto weights = axis_weights(a, n.diagonal[row] + n.R[row], n.mu[row]);
    n.axis_press[row] = weights.press;
    n.axis_slip[row] = weights.slip;
  }
  return n.diagonal[first] + n.R[first] > 0.0;
}

/// The iteration's compliances of a cone. The weight of the proximal term is the lack to the share `least` of A's
/// diagonal, or to the largest tangential one. Returns whether there is any.
STICTION_HD bool set_compliances(const BlockTerms& terms, Index c, double least) {
  /// Term added to a compliance beyond a rounding.
  constexpr double kRounding = 0x1p-48;
  const BlockWorkspace& n = terms.n;
  const Index first = terms.cones().row[c], end = terms.cones().row[c + 1];
  bool is_missing = false;
  const auto add_prox = [&](Index row, double wanted) {
    const double prox = wanted - n.R[row];
    n.prox[row] = prox > kRounding * wanted ? prox : 0.0;
    is_missing = is_missing || n.prox[row] > 0.0;
  };
  const double normal = raised_compliance(n.diagonal[first], n.R[first], least);
  add_prox(first, normal);
  n.law[3 * c] = div_(1.0, normal);
  if (end - first == 1) return is_missing;
  double mean = 0.0;
  double most = 0.0;
  for (Index row = first + 1; row < end; ++row) {
    most = max_((n.mu[row] * n.mu[row]) * n.R[row], most);
    mean = fma_(n.mu[row] * n.mu[row], n.diagonal[row], mean);
  }
  const double tangential = raised_compliance(div_(mean, static_cast<double>(end - first - 1)), most, least);
  for (Index row = first + 1; row < end; ++row)
    if (n.mu[row] > 0.0) add_prox(row, div_(tangential, n.mu[row] * n.mu[row]));
  n.law[3 * c + 1] = div_(1.0, tangential);
  n.law[3 * c + 2] = div_(1.0, normal + tangential);
  return is_missing;
}

}  // namespace stiction::inline STICTION_ISA
