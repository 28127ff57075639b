#pragma once

#include "core/algorithm/derivative/jacobian_pack_workspace.hpp"
#include "core/algorithm/derivative/reaction_slope.hpp"
#include "core/algorithm/velocity/evaluate/evaluate_pack.hpp"
#include "core/algorithm/velocity/iterate/hessian_rows.hpp"

/// Adjoint velocities, or changes of velocities, of environments side by side, in double (docs/math/derivative.md, (32)
/// to (36)).
namespace stiction::inline STICTION_ISA {

/// The pack seen from lane `part.first` on.
template <class Types>
struct JacobianPackHalf {
  using Double = typename Types::Double;
  using Doubles = typename Types::Doubles;
  using Value = Double;
  const JacobianPackWorkspace<Types>& workspace;
  const DoublePack<Types> part;
  const TreeOf<Types>& tree = part.tree;
  const SlotOf<Types>* slots = part.slots;
  const SlotCounts& counts = part.counts;

  [[nodiscard]] STICTION_HD Doubles array(double* data) const { return part.array(data); }
  [[nodiscard]] STICTION_HD Double number(const typename Types::Numbers& numbers, Offset i) const {
    return part.number(numbers, i);
  }

  /// Counts of each lane's cones.
  struct ModeCounts {
    Double unknowns{0};
    Double degenerate{0};
  };
  static STICTION_HD Double one_where(Mask<Double> mask) { return select(mask, Double(1), Double(0)); }

  template <int kRows>
  STICTION_HD void find_cone_slope(const SlotOf<Types>& slot, Index s, Double tie, ModeCounts& found) const {
    SlopePoint<kRows, Double> point;
    for (int k = 0; k < kRows; ++k) {
      const Double mu = number(workspace.mu, slot.row + k);
      point.mu[k] = mu;
      point.x[k] = unit_reaction(number(workspace.x, slot.row + k), mu);
      point.y[k] = mu * array(workspace.motion)[slot.row + k];
      point.R[k] = mu * mu * number(workspace.R, slot.row + k);
    }
    point.a = part.mean_diagonal(slot);
    const auto slope = reaction_slope(point, tie);
    const auto has = number(workspace.marks(), slot.row) >= Double(0);
    const Doubles of_cone = array(workspace.slope_of_cone);
    of_cone.put(4 * s, slope.normal);
    of_cone.put(4 * s + 1, slope.inverse);
    of_cone.put(4 * s + 2, slope.bend);
    of_cone.put(4 * s + 3, one_where(slope.slides));
    for (int k = 1; k < kRows; ++k) {
      array(workspace.slope_p).put(slot.row + k, slope.p[k]);
      array(workspace.slope_q).put(slot.row + k, slope.q[k]);
    }
    found.unknowns = found.unknowns + select(has, slope.unknowns, Double(0));
    found.degenerate = found.degenerate + one_where(and_(has, slope.is_tied));
  }

  STICTION_HD void find_row_slope(const SlotOf<Types>& slot, Index s, Double tie, ModeCounts& found) const {
    const Double a = part.mean_diagonal(slot), mark = number(workspace.marks(), slot.row);
    const Double z = natural_point(a, number(workspace.x, slot.row), array(workspace.motion)[slot.row]);
    const auto mode =
        row_mode(z, a, number(workspace.law, 3 * s + 1), number(workspace.law, 3 * s + 2), mark > Double(0), tie);
    const auto has = mark >= Double(0);
    const auto moves = and_(has, mode.moves);
    const Double R = number(workspace.R, slot.row);
    array(workspace.slope_p).put(slot.row, select(moves, div_(Double(1), R), Double(0)));
    array(workspace.slope_q).put(slot.row, one_where(mode.at_hi) - one_where(mode.at_lo));
    found.unknowns = found.unknowns + one_where(moves);
    found.degenerate = found.degenerate + one_where(and_(has, mode.is_tied));
  }

  /// T of all cones at the answer, whose motion evaluate() has written.
  STICTION_HD_OUTLINE ModeCounts find_slopes(Double tie) const {
    ModeCounts found;
    visit_slots(
        slots, counts, [&](const auto& slot, Index s) { find_row_slope(slot, s, tie, found); },
        [&](auto shape, const auto& slot, Index s) { find_cone_slope<decltype(shape)::kRows>(slot, s, tie, found); });
    return found;
  }

  /// out = T in for the rows of a cone, in the batch's coordinates.
  template <bool kCone, int kRows>
  STICTION_HD void times_hessian_rows(const SlotOf<Types>& slot, Index s, Index from, const Double (&in)[kRows],
                                      Double (&out)[kRows]) const {
    const Doubles p = array(workspace.slope_p), q = array(workspace.slope_q);
    if constexpr (!kCone) {
      for (int k = 0; k < kRows; ++k) out[k] = p[slot.row + from + k] * in[k];
    } else {
      const Doubles of_cone = array(workspace.slope_of_cone);
      const Double inverse = of_cone[4 * s + 1];
      Double along(0);
      Double scaled[kRows];
      for (int k = 1; k < kRows; ++k) {
        scaled[k] = number(workspace.mu, slot.row + k) * in[k];
        along = fma_(q[slot.row + k], scaled[k], along);
      }
      out[0] = of_cone[4 * s] * in[0] - inverse * along;
      const Double pull = fma_(inverse, in[0], of_cone[4 * s + 2] * along);
      for (int k = 1; k < kRows; ++k)
        out[k] = number(workspace.mu, slot.row + k) * (p[slot.row + k] * scaled[k] - q[slot.row + k] * pull);
    }
  }

  [[nodiscard]] STICTION_HD Double entry(Offset i) const { return number(workspace.J, i); }
  [[nodiscard]] STICTION_HD Doubles hessian() const { return array(workspace.system); }
  /// H = M + J'TJ, factored; the lanes in which it is positive definite.
  STICTION_HD_OUTLINE Mask<Double> factor_system() const {
    const Doubles H = hessian();
    for (Index e = 0; e < tree.entries; ++e) H.put(e, number(workspace.M, e));
    HessianRows<JacobianPackHalf>{*this}.add();
    SerialTeam team;
    return factor_tree(team, tree, H, array(workspace.system_pivot));
  }

  /// sum += J' in of one slot, in[k] its rows'.
  template <int kRows>
  STICTION_HD void push_rows(const SlotOf<Types>& slot, const Doubles& sum, const Double (&in)[kRows]) const {
    for (int k = 0; k < kRows; ++k) {
      const Offset first = slot.entry + static_cast<Offset>(k) * slot.columns;
      for (Index c = 0; c < slot.columns; ++c) sum.put(slot.dof[c], fma_(entry(first + c), in[k], sum[slot.dof[c]]));
    }
  }
  /// f(kCone, kRows, slot, number) of every slot, the first two as integral constants.
  template <class F>
  STICTION_HD void visit(F&& f) const {
    visit_slots(
        slots, counts,
        [&](const auto& slot, Index s) { f(std::false_type{}, std::integral_constant<int, 1>{}, slot, s); },
        [&](auto shape, const auto& slot, Index s) {
          f(std::true_type{}, std::integral_constant<int, decltype(shape)::kRows>{}, slot, s);
        });
  }

  /// adjoint = H^-1 (v_bar + J' (w_bar - T (lambda_bar + R w_bar))).
  STICTION_HD_OUTLINE void solve_adjoint() const {
    const Doubles a = array(workspace.adjoint);
    for (Index k = 0; k < tree.dofs; ++k) a.put(k, number(workspace.v_bar(), k));
    visit([&](auto is_cone, auto rows, const auto& slot, Index s) {
      constexpr int kRows = decltype(rows)::value;
      Double in[kRows];
      Double out[kRows];
      for (int k = 0; k < kRows; ++k) {
        const Index row = slot.row + k;
        in[k] = fma_(number(workspace.R, row), number(workspace.w_bar(), row), number(workspace.lambda_bar(), row));
      }
      times_hessian_rows<decltype(is_cone)::value, kRows>(slot, s, 0, in, out);
      for (int k = 0; k < kRows; ++k) out[k] = number(workspace.w_bar(), slot.row + k) - out[k];
      push_rows<kRows>(slot, a, out);
    });
    SerialTeam team;
    solve_tree(team, tree, hessian(), array(workspace.system_pivot), a);
  }

  /// nu and image at the adjoint velocity, and force = v_bar + J' nu, which is M a of the exact one.
  STICTION_HD_OUTLINE void follow_adjoint() const {
    const Doubles a = array(workspace.adjoint), force = array(workspace.force), nu = array(workspace.nu);
    for (Index k = 0; k < tree.dofs; ++k) force.put(k, number(workspace.v_bar(), k));
    visit([&](auto is_cone, auto rows, const auto& slot, Index s) {
      constexpr int kRows = decltype(rows)::value;
      Double seed[kRows];
      Double in[kRows];
      Double out[kRows];
      for (int k = 0; k < kRows; ++k) {
        const Index row = slot.row + k;
        seed[k] = number(workspace.lambda_bar(), row);
        const Offset first = slot.entry + static_cast<Offset>(k) * slot.columns;
        for (Index c = 0; c < slot.columns; ++c) seed[k] = fma_(entry(first + c), a[slot.dof[c]], seed[k]);
        in[k] = fma_(number(workspace.R, row), number(workspace.w_bar(), row), seed[k]);
      }
      times_hessian_rows<decltype(is_cone)::value, kRows>(slot, s, 0, in, out);
      for (int k = 0; k < kRows; ++k) {
        const Index row = slot.row + k;
        out[k] = number(workspace.w_bar(), row) - out[k];
        nu.put(row, out[k]);
        array(workspace.image).put(row, fma_(number(workspace.R, row), out[k], seed[k]));
      }
      push_rows<kRows>(slot, force, out);
    });
  }

  /// The square of how far M a is from `force`, relative to what a is made of. It is in the metric of H's pivots, so
  /// that no unit matters. The difference goes to scratch.
  STICTION_HD_OUTLINE Double adjoint_residual() const {
    const Doubles a = array(workspace.adjoint), force = array(workspace.force), left = array(workspace.scratch);
    part.push_mass(left, [&](Index k) { return a[k]; });
    Double largest(0);
    Double scale(0);
    for (Index k = 0; k < tree.dofs; ++k) {
      const Double pivot = array(workspace.system_pivot)[k], own = number(workspace.v_bar(), k);
      const Double missing = force[k] - left[k], pulled = force[k] - own;
      left.put(k, missing);
      largest = max_(missing * missing * pivot, largest);
      scale = max_(max_(own * own, pulled * pulled) * pivot, scale);
    }
    return select(scale > Double(0), div_(largest, select(scale > Double(0), scale, Double(1))), largest);
  }

  /// adjoint += H^-1 of what adjoint_residual() left, in the lanes of `where`.
  STICTION_HD_OUTLINE void refine(Mask<Double> where) const {
    const Doubles a = array(workspace.adjoint), left = array(workspace.scratch);
    SerialTeam team;
    solve_tree(team, tree, hessian(), array(workspace.system_pivot), left);
    for (Index k = 0; k < tree.dofs; ++k) a.put(k, select(where, a[k] + left[k], a[k]));
  }
};

}  // namespace stiction::inline STICTION_ISA
