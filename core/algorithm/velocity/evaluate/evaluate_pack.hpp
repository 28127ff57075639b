#pragma once

#include "core/algorithm/newton/cone_response.hpp"
#include "core/algorithm/residual/final_residual.hpp"
#include "core/algorithm/velocity/evaluate/newton_progress.hpp"
#include "core/algorithm/velocity/evaluate/pack_diagonal.hpp"
#include "core/algorithm/velocity/evaluate/pack_islands.hpp"
#include "core/algorithm/velocity/lanes/tree_factor.hpp"
#include "core/algorithm/velocity/load/load_pack.hpp"

/// Evaluates what decides about an answer, in double whatever the iteration's precision. These are
/// v+ = v_free + M^-1 J' x, the motion of all rows and the errors of contacts. They are evaluated for as many lanes as
/// a vector of doubles has, from lane `first` on.
namespace stiction::inline STICTION_ISA {

/// Share of A's diagonal that is compliance enough for a free row, which has no zone that a step could leave. The
/// answer's residual loses 16 digits less those of this number.
inline constexpr double kLeastFreeCompliance = 1e-5;

/// The pack seen from lane `first` on, in double.
template <class Types>
struct DoublePack {
  using Double = typename Types::Double;
  using Doubles = typename Types::Doubles;
  const VelocityWorkspace<Types>& workspace;
  const TreeOf<Types>& tree;
  const SlotOf<Types>* slots;
  const SlotCounts& counts;
  int first;
  MassForm mass;

  [[nodiscard]] STICTION_HD Doubles array(double* data) const { return {data + first}; }
  [[nodiscard]] STICTION_HD Double number(const typename Types::Numbers& numbers, Offset i) const {
    return doubles<Double>(numbers, i, first);
  }

  /// M = L'DL; the lanes in which M is positive definite. From a factor that came as M, M is made here: its sums are
  /// rounded once, and no evaluation uses them.
  STICTION_HD_OUTLINE Mask<Double> factor_mass() const {
    const Doubles factor = array(workspace.factor);
    auto&& team = workspace.team();
    const auto load = [&] { for_each(team, tree.entries, [&](Index e) { factor.put(e, number(workspace.M, e)); }); };
    load();
    if (mass == MassForm::matrix) return factor_tree(team, tree, factor, array(workspace.pivot));
    multiply_tree(team, tree, factor);
    for_each(team, tree.entries, [&](Index e) { put(workspace.H, e, factor[e]); });
    load();
    const auto definite = split_pivots(team, tree, factor, array(workspace.pivot));
    for_each(team, tree.entries, [&](Index e) { put(workspace.M, e, number(workspace.H, e)); });
    return definite;
  }

  STICTION_HD void put(const typename Types::Numbers& numbers, Offset i, Double value) const {
    narrow(value, numbers.data + i * Types::kStride + first);
  }

  /// sum += sign J' x.
  STICTION_HD void push(const Doubles& sum, Double sign) const {
    auto&& team = workspace.team();
    for_each_in_turn(team, slots, counts.slots, [&](auto& workers, Index s) -> Index {
      with_rows(slots, s, [&](auto rows, const auto& slot) {
        constexpr int kRows = decltype(rows)::value;
        Double x[kRows];
        for (int k = 0; k < kRows; ++k) x[k] = sign * number(workspace.x, slot.row + k);
        share(workers, slot.columns, [&](Index c) {
          Double own = sum[slot.dof[c]];
          for (int k = 0; k < kRows; ++k)
            own = fma_(number(workspace.J, slot.entry + static_cast<Offset>(k) * slot.columns + c), x[k], own);
          sum.put(slot.dof[c], own);
        });
      });
      return 1;
    });
  }

  /// velocity = v_free + M^-1 J' x.
  STICTION_HD_OUTLINE void move() const {
    const Doubles pushed = array(workspace.scratch);
    workspace.each(tree.dofs, [&](Index k) { pushed.put(k, Double(0)); });
    push(pushed, Double(1));
    auto&& team = workspace.team();
    solve_tree(team, tree, array(workspace.factor), array(workspace.pivot), pushed);
    const Doubles velocity = array(workspace.velocity);
    workspace.each(tree.dofs, [&](Index k) { velocity.put(k, number(workspace.v_free, k) + pushed[k]); });
  }

  /// J velocity - target of a row.
  STICTION_HD Double row_motion(const SlotOf<Types>& slot, Index k, const Doubles& velocity) const {
    Double sum = Double(0) - number(workspace.target, slot.row + k);
    const Offset entry = slot.entry + static_cast<Offset>(k) * slot.columns;
    for (Index c = 0; c < slot.columns; ++c) sum = fma_(number(workspace.J, entry + c), velocity[slot.dof[c]], sum);
    return sum;
  }

  /// Writes down where the steps since the last time led to, and z there. Steps add to z what they change, in the
  /// iteration's precision; this is what that is accurate to.
  STICTION_HD_OUTLINE void refresh_motion() const {
    const Doubles v = array(workspace.v);
    const typename Types::Numbers& dv = workspace.dv;
    workspace.each(tree.dofs, [&](Index k) { v.put(k, v[k] + number(dv, k)); });
    workspace.each(counts.slots, [&](Index s) {
      for (Index k = 0; k < slots[s].rows; ++k) {
        const Index row = slots[s].row + k;
        put(workspace.z, row, row_motion(slots[s], k, v) + number(workspace.shift, row));
      }
    });
  }

  /// step = v - v_free.
  STICTION_HD void write_change() const {
    workspace.each(tree.dofs,
                   [&](Index k) { put(workspace.step, k, array(workspace.v)[k] - number(workspace.v_free, k)); });
  }

  /// gradient = M (v - v_free) - J' x.
  STICTION_HD_OUTLINE void refresh_gradient() const {
    const Doubles v = array(workspace.v), sum = array(workspace.scratch);
    push_mass(sum, [&](Index k) { return v[k] - number(workspace.v_free, k); });
    push(sum, Double(-1));
    workspace.each(tree.dofs, [&](Index k) { put(workspace.gradient, k, sum[k]); });
  }

  /// sum = M change.
  template <class F>
  STICTION_HD void push_mass(const Doubles& sum, F&& change) const {
    auto&& team = workspace.team();
    if (mass == MassForm::factor) {
      push_change(sum, change);
    } else {
      multiply_symmetric(team, tree, [&](Index e) { return number(workspace.M, e); }, change, sum);
    }
  }

  /// sum += L'DL change, by the factor that evaluations move v with: where the gradient is zero, they find v. It takes
  /// as many multiplications as M does, and M as rounded would be another problem.
  template <class F>
  STICTION_HD void push_change(const Doubles& sum, F&& change) const {
    const Doubles factor = array(workspace.factor), force = array(workspace.force);
    auto&& team = workspace.team();
    workspace.each(tree.dofs, [&](Index k) {
      const Doubles row = factor.from(tree.begin[k]);
      const SmallOf<Types>* const path = tree.path(k);
      Double own = change(k);
      for (Index d = tree.first(k); d < tree.depth[k]; ++d) own = fma_(row[d], change(path[d]), own);
      own = row[tree.depth[k]] * own;
      force.put(k, own);
      sum.put(k, Double(0) + own);
    });
    for (Index k = 0; k < tree.dofs; ++k) {
      const Doubles row = factor.from(tree.begin[k]);
      add_column(team, tree, k, force[k], [&](Index d) { return row[d]; }, sum);
    }
  }

  /// The diagonal of A = J M^-1 J'.
  STICTION_HD_OUTLINE void find_diagonal() const { PackDiagonal<DoublePack>{*this}.find(); }

  /// Lanes whose row of A has a diagonal that is not positive, and those to which a proximal term was given.
  struct LawLanes {
    Mask<Double> bad;
    Mask<Double> proximal;
  };
  /// Adds what is missing in a row's compliance. The lanes in which that is more than a rounding.
  STICTION_HD Mask<Double> add_prox(Index row, Double wanted, Mask<Double> where) const {
    constexpr double kRounding = sizeof(typename Types::Real) == sizeof(float) ? 0x1p-20 : 0x1p-48;
    const Double prox = wanted - number(workspace.R, row);
    const auto added = and_(where, prox > Double(kRounding) * wanted);
    put(workspace.prox, row, select(added, prox, Double(0)));
    return added;
  }

  /// The iteration's compliance of a slot's first row.
  [[nodiscard]] STICTION_HD Double first_compliance(Index s, Double diagonal, Double given) const {
    const Double raised = raised_compliance(diagonal, given, kLeastCompliance);
    if (slots[s].rows > 1) return raised;
    const Double infinite(__builtin_huge_val());
    const auto is_free =
        and_(number(workspace.law, 3 * s + 1) == Double(0) - infinite, number(workspace.law, 3 * s + 2) == infinite);
    return select(and_(is_free, given > Double(kLeastFreeCompliance) * diagonal), given, raised);
  }

  /// The iteration's compliances of a slot.
  STICTION_HD void set_law(Index s, LawLanes& lanes) const {
    const auto& slot = slots[s];
    const Doubles diagonal = array(workspace.diagonal);
    const Double given = number(workspace.R, slot.row);
    lanes.bad = or_(lanes.bad, not_(diagonal[slot.row] + given > Double(0)));
    const Double normal = first_compliance(s, diagonal[slot.row], given);
    lanes.proximal = or_(lanes.proximal, add_prox(slot.row, normal, Double(0) == Double(0)));
    put(workspace.law, 3 * s, div_(Double(1), normal));
    if (slot.rows == 1) return;
    Double most(0);
    Double mean(0);
    for (Index row = slot.row + 1; row < slot.row + slot.rows; ++row) {
      const Double mu = number(workspace.mu, row);
      most = max_(mu * mu * number(workspace.R, row), most);
      mean = fma_(mu * mu, diagonal[row], mean);
    }
    const Double tangential =
        raised_compliance(div_(mean, Double(static_cast<double>(slot.rows - 1))), most, kLeastCompliance);
    for (Index row = slot.row + 1; row < slot.row + slot.rows; ++row) {
      const Double mu = number(workspace.mu, row);
      const auto has_friction = mu > Double(0);
      const Double wanted = div_(tangential, select(has_friction, mu * mu, Double(1)));
      lanes.proximal = or_(lanes.proximal, add_prox(row, wanted, has_friction));
    }
    put(workspace.law, 3 * s + 1, div_(Double(1), tangential));
    put(workspace.law, 3 * s + 2, div_(Double(1), normal + tangential));
  }
  STICTION_HD_OUTLINE LawLanes set_laws() const {
    const auto none = Double(0) > Double(0);
    LawLanes lanes{none, none};
    workspace.each(counts.slots, [&](Index s) { set_law(s, lanes); });
    return {not_(workspace.all(not_(lanes.bad))), not_(workspace.all(not_(lanes.proximal)))};
  }

  /// Units of errors: b, which goes to `motion`, metrics of cones, and islands (docs/math/residual.md). Returns the
  /// largest island's error scale. `is_one`: all cones are of one island.
  STICTION_HD_OUTLINE Double find_scale(Law law, bool is_one = false) const {
    const Doubles velocity = array(workspace.velocity), motion = array(workspace.motion);
    workspace.each(tree.dofs, [&](Index k) { velocity.put(k, number(workspace.v_free, k)); });
    Double largest(0);
    workspace.each(counts.slots, [&](Index s) {
      for (Index k = 0; k < slots[s].rows; ++k) {
        const Double b = row_motion(slots[s], k, velocity);
        motion.put(slots[s].row + k, b);
        largest = max_(abs_(b), largest);
      }
    });
    largest = workspace.largest(largest);
    Double unit;
    {
      double units[Types::kDoubleLanes];
      for (int l = 0; l < Types::kDoubleLanes; ++l) units[l] = error_unit(lane_of(largest, l));
      load_lanes(units, unit);
    }
    workspace.once([&] { array(workspace.error_unit).put(0, unit); });
    Double most(0);
    workspace.each(counts.slots, [&](Index s) {
      set_metric(slots[s]);
      const Double own = div_(
          with_law(s, law, [&](auto shape, auto of) { return error_at_rest<decltype(of)::value>(shape, s); }), unit);
      array(workspace.share_of).put(s, own);
      most = max_(own, most);
    });
    most = workspace.largest(most);
    if (is_one) {
      workspace.each(counts.slots, [&](Index s) { array(workspace.share_of).put(s, Double(1)); });
    } else {
      PackIslands<DoublePack>{*this}.weigh(most);
    }
    return most;
  }

  STICTION_HD void set_metric(const SlotOf<Types>& slot) const {
    const Doubles diagonal = array(workspace.diagonal);
    const Double a = press_of(slot);
    for (Index row = slot.row + 1; row < slot.row + slot.rows; ++row) {
      const auto weights = axis_weights(a, diagonal[row] + number(workspace.R, row), number(workspace.mu, row));
      array(workspace.axis_press).put(row, weights.press);
      array(workspace.axis_slip).put(row, weights.slip);
    }
  }
  [[nodiscard]] STICTION_HD Double press_of(const SlotOf<Types>& slot) const {
    return max_(array(workspace.diagonal)[slot.row] + number(workspace.R, slot.row), Double(0));
  }
  /// The mean diagonal of a slot's block, before mu.
  [[nodiscard]] STICTION_HD Double mean_diagonal(const SlotOf<Types>& slot) const {
    const Doubles diagonal = array(workspace.diagonal);
    Double sum(0);
    for (Index row = slot.row; row < slot.row + slot.rows; ++row)
      sum = sum + (diagonal[row] + number(workspace.R, row));
    return residual_weight(div_(sum, Double(static_cast<double>(slot.rows))));
  }
  template <class Shape>
  [[nodiscard]] STICTION_HD auto metric_of(Shape, const SlotOf<Types>& slot) const {
    ConeMetric<Double, Shape::kRows> metric;
    metric.a = press_of(slot);
    for (int k = 1; k < Shape::kRows; ++k) {
      metric.press[k] = array(workspace.axis_press)[slot.row + k];
      metric.slip[k] = array(workspace.axis_slip)[slot.row + k];
    }
    return metric;
  }

  /// f(shape, constant of a law) of a slot. Rows between bounds are boxes, whatever their kind: a free row has infinite
  /// ones.
  template <class F>
  STICTION_HD Double with_law(Index s, Law law, F&& f) const {
    if (slots[s].rows == 1) return f(ConeShape<ConeKind::box, 1>{}, LawConstant<Law::convex>{});
    return with_shape(ConeKind::friction, slots[s].rows, [&](auto shape) -> Double {
      if constexpr (decltype(shape)::kKind == ConeKind::friction) {
        if (law == Law::coulomb) return f(shape, LawConstant<Law::coulomb>{});
        return f(shape, LawConstant<Law::convex>{});
      } else {
        return Double(0);
      }
    });
  }
  /// The error of a slot's cone at b, without a reaction, in units of 1 / error_unit.
  template <Law kLaw, class Shape>
  [[nodiscard]] STICTION_HD Double error_at_rest(Shape shape, Index s) const {
    constexpr int kRows = Shape::kRows;
    const auto& slot = slots[s];
    const Double unit = array(workspace.error_unit)[0];
    Double none[kRows];
    Double y[kRows];
    Double largest(0);
    for (int k = 0; k < kRows; ++k) {
      const Double b = array(workspace.motion)[slot.row + k] * unit;
      none[k] = Double(0);
      y[k] = k == 0 ? b : number(workspace.mu, slot.row + k) * b;
      largest = max_(abs_(b), largest);
    }
    Double lo(0), hi(0);
    if constexpr (kRows == 1) {
      lo = number(workspace.law, 3 * s + 1) * unit;
      hi = number(workspace.law, 3 * s + 2) * unit;
    }
    const Double square = law_error_square<kLaw>(shape, none, y, metric_of(shape, slot), lo, hi);
    return max_(sqrt_(square), Double(static_cast<double>(kIdleShare)) * largest);
  }

  using Evaluated = LargestResidual<Double>;

  template <Law kLaw, class Shape>
  STICTION_HD void evaluate_slot(Shape shape, Index index, Evaluated& evaluated) const {
    const auto& slot = slots[index];
    constexpr int kRows = Shape::kRows;
    const Doubles velocity = array(workspace.velocity), motion = array(workspace.motion);
    Double x[kRows];
    Double y[kRows];
    const auto load = [&](Index k) {
      x[k] = number(workspace.x, slot.row + k);
      y[k] = fma_(number(workspace.R, slot.row + k), x[k], row_motion(slot, k, velocity));
      motion.put(slot.row + k, y[k]);
    };
    load(0);
    for (int k = 1; k < kRows; ++k) {
      load(k);
      const Double mu = number(workspace.mu, slot.row + k);
      x[k] = unit_reaction(x[k], mu);
      y[k] = mu * y[k];
    }
    Double lo(0);
    Double hi(0);
    if constexpr (kRows == 1) {
      lo = number(workspace.law, 3 * index + 1);
      hi = number(workspace.law, 3 * index + 2);
    }
    evaluated.template add<kLaw>(shape, x, y, metric_of(shape, slot), lo, hi, array(workspace.share_of)[index],
                                 array(workspace.error_unit)[0]);
  }

  STICTION_HD_OUTLINE Evaluated evaluate(Law law) const {
    move();
    Evaluated evaluated;
    workspace.each(counts.slots, [&](Index s) {
      with_law(s, law, [&](auto shape, auto of) {
        evaluate_slot<decltype(of)::value>(shape, s, evaluated);
        return Double(0);
      });
    });
    for (Double* own : {&evaluated.square, &evaluated.stuck, &evaluated.plain, &evaluated.size, &evaluated.reaction})
      *own = workspace.largest(*own);
    return evaluated;
  }
};

}  // namespace stiction::inline STICTION_ISA
