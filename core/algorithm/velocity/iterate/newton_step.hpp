#pragma once

#include "core/algorithm/newton/cone_response.hpp"
#include "core/algorithm/velocity/iterate/hessian_rows.hpp"
#include "core/algorithm/velocity/load/load_pack.hpp"

/// The pieces of an iteration: reactions, gradient, Hessian, and the function along a line
/// (docs/math/velocity_newton.md).
namespace stiction::inline STICTION_ISA {

/// start + sum of a b over terms 0, 1, ..., each a fused operation, in that order. A team's lanes find terms, and each
/// adds all of them up.
template <class Types>
struct OrderedSum {
  using Wide = typename Types::Wide;
  static constexpr bool kAdds = kIsAlone<typename Types::Team>;
  typename Types::Numbers terms;
  Wide sum;

  STICTION_HD void add(Offset term, Wide a, Wide b) {
    if constexpr (kAdds) {
      sum = fma_(a, b, sum);
    } else {
      terms.put(2 * term, a);
      terms.put(2 * term + 1, b);
    }
  }
  /// The sum of so many terms, all of which every lane sees.
  STICTION_HD Wide total(Index count) {
    if constexpr (!kAdds)
      for (Index i = 0; i < count; ++i) sum = fma_(terms[2 * i], terms[2 * i + 1], sum);
    return sum;
  }
};

/// A pack in the iteration's precision.
template <class Types>
struct NewtonPack {
  using Wide = typename Types::Wide;
  using Numbers = typename Types::Numbers;
  using Value = Wide;
  const VelocityWorkspace<Types>& workspace;
  const TreeOf<Types>& tree;
  const SlotOf<Types>* slots;
  const SlotCounts& counts;

  [[nodiscard]] STICTION_HD RowLaw<Wide> row_law(Index s) const {
    return {workspace.law[3 * s], workspace.law[3 * s + 1], workspace.law[3 * s + 2]};
  }
  [[nodiscard]] STICTION_HD ConeLaw<Wide> cone_law(Index s) const {
    return {workspace.law[3 * s], workspace.law[3 * s + 1], workspace.law[3 * s + 2]};
  }

  /// visit_slot() of all slots, shared out over the team; ends in a sync.
  template <class F, class G>
  STICTION_HD void for_each_slot(F&& f, G&& g) const {
    workspace.each(counts.slots, [&](Index s) { visit_slot(slots, s, f, g); });
  }

  /// Row k of a slot times a vector by degree of freedom.
  STICTION_HD Wide times_row(const SlotOf<Types>& slot, Index k, const Numbers& vector, Wide sum) const {
    const Numbers entries = workspace.J.from(slot.entry + static_cast<Offset>(k) * slot.columns);
    for (Index c = 0; c < slot.columns; ++c) sum = fma_(entries[c], vector[slot.dof[c]], sum);
    return sum;
  }
  /// vector -= J' amount of a slot's rows, in their order; rows whose amount is zero in every lane are left out.
  template <Team TeamT, int kRows>
  STICTION_HD void subtract_rows(TeamT& workers, const SlotOf<Types>& slot, const Numbers& vector,
                                 const Wide (&amount)[kRows]) const {
    bool is_any[kRows];
    bool is_one = false;
    for (int k = 0; k < kRows; ++k) is_one = (is_any[k] = any(amount[k] != Wide(0))) || is_one;
    if (!is_one) return;
    const Numbers entries = workspace.J.from(slot.entry);
    share(workers, slot.columns, [&](Index c) {
      Wide sum = vector[slot.dof[c]];
      for (int k = 0; k < kRows; ++k)
        if (is_any[k]) sum = fma_(entries[static_cast<Offset>(k) * slot.columns + c], Wide(0) - amount[k], sum);
      vector.put(slot.dof[c], sum);
    });
  }

  /// Reactions and their slopes at z.
  STICTION_HD_OUTLINE void refresh_reactions() const {
    for_each_slot(
        [&](const auto& slot, Index s) {
          const RowReaction<Wide> point = row_reaction(row_law(s), workspace.z[slot.row]);
          workspace.x.put(slot.row, point.x);
          workspace.G_rows.put(slot.row, point.slope);
        },
        [&](auto shape, const auto& slot, Index s) {
          constexpr int kRows = decltype(shape)::kRows;
          Wide z[kRows];
          z[0] = workspace.z[slot.row];
          for (int k = 1; k < kRows; ++k) z[k] = workspace.mu[slot.row + k] * workspace.z[slot.row + k];
          const ConeReaction<Wide> point = cone_reaction(cone_law(s), z[0], tangential_norm<kRows>(z));
          workspace.x.put(slot.row, point.x_n);
          workspace.G_rows.put(slot.row, point.normal);
          for (int k = 1; k < kRows; ++k) {
            const Wide minus = Wide(0) - z[k];
            workspace.x.put(slot.row + k, workspace.mu[slot.row + k] * (point.across * minus));
            workspace.G_rows.put(slot.row + k, minus * point.inverse_length);
          }
          const Index cone = s - counts.singles;
          workspace.G_cones.put(3 * cone, point.across);
          workspace.G_cones.put(3 * cone + 1, point.slide);
          workspace.G_cones.put(3 * cone + 2, point.bend);
        });
  }

  /// The cones' potentials at z, whose reactions are x. A cone's is R' |x|^2 / 2; a row that is held at a bound adds
  /// what is linear beyond it.
  STICTION_HD_OUTLINE Wide potential() const {
    Wide sum(0);
    for (Index row = 0; row < counts.rows; ++row) {
      const Wide half = Wide(0.5) * (workspace.R[row] + workspace.prox[row]);
      sum = fma_(workspace.x[row], Wide(0) - fma_(half, workspace.x[row], workspace.z[row]), sum);
    }
    return sum;
  }
  /// step' M step / 2. `inverse` gets the forces; no step is being made.
  STICTION_HD_OUTLINE Wide energy() const {
    workspace.each(tree.dofs, [&](Index k) {
      const Numbers row = workspace.M.from(tree.begin[k]);
      const SmallOf<Types>* const path = tree.path(k);
      Wide force = Wide(0.5) * row[tree.depth[k]] * workspace.step[k];
      for (Index d = tree.first(k); d < tree.depth[k]; ++d) force = fma_(row[d], workspace.step[path[d]], force);
      workspace.inverse.put(k, force);
    });
    Wide sum(0);
    for (Index k = 0; k < tree.dofs; ++k) sum = fma_(workspace.inverse[k], workspace.step[k], sum);
    return sum;
  }

  /// out = G in for the rows of a cone, in the batch's coordinates.
  template <int kRows>
  STICTION_HD void times_hessian(const SlotOf<Types>& slot, Index s, const Wide (&in)[kRows],
                                 Wide (&out)[kRows]) const {
    const Index cone = s - counts.singles;
    const Wide across = workspace.G_cones[3 * cone];
    const Wide slide = workspace.G_cones[3 * cone + 1];
    const Wide bend = workspace.G_cones[3 * cone + 2];
    Wide along(0);
    Wide scaled[kRows];
    for (int k = 1; k < kRows; ++k) {
      scaled[k] = workspace.mu[slot.row + k] * in[k];
      along = fma_(workspace.G_rows[slot.row + k], scaled[k], along);
    }
    out[0] = fma_(slide, along, workspace.G_rows[slot.row] * in[0]);
    const Wide pull = fma_(slide, in[0], bend * along);
    for (int k = 1; k < kRows; ++k)
      out[k] = workspace.mu[slot.row + k] * fma_(pull, workspace.G_rows[slot.row + k], across * scaled[k]);
  }

  /// out = G in for rows of a slot, or of kRows slots of one row each that touch the same degrees of freedom.
  template <bool kCone, int kRows>
  STICTION_HD void times_hessian_rows(const SlotOf<Types>& slot, Index s, Index from, const Wide (&in)[kRows],
                                      Wide (&out)[kRows]) const {
    if constexpr (kCone) {
      times_hessian<kRows>(slot, s, in, out);
    } else {
      for (int k = 0; k < kRows; ++k) out[k] = workspace.G_rows[slot.row + from + k] * in[k];
    }
  }

  [[nodiscard]] STICTION_HD Wide entry(Offset i) const { return workspace.J[i]; }
  [[nodiscard]] STICTION_HD const Numbers& hessian() const { return workspace.H; }
  /// H = M + J'GJ.
  STICTION_HD_OUTLINE void refresh_hessian() const {
    workspace.each(tree.entries, [&](Index e) { workspace.H.put(e, workspace.M[e]); });
    HessianRows<NewtonPack>{*this}.add();
  }

  /// gradient = J' G J p.
  STICTION_HD_OUTLINE void push_back() const {
    workspace.each(tree.dofs, [&](Index k) { workspace.gradient.put(k, Wide(0)); });
    auto&& team = workspace.team();
    for_each_in_turn(team, slots, counts.slots, [&](auto& workers, Index s) -> Index {
      visit_slot(
          slots, s,
          [&](const auto& slot, Index) {
            const Wide amount[1] = {Wide(0) - workspace.G_rows[slot.row] * workspace.Jp[slot.row]};
            subtract_rows(workers, slot, workspace.gradient, amount);
          },
          [&](auto shape, const auto& slot, Index) {
            constexpr int kRows = decltype(shape)::kRows;
            Wide Jp[kRows];
            Wide GJp[kRows];
            for (int k = 0; k < kRows; ++k) Jp[k] = workspace.Jp[slot.row + k];
            times_hessian<kRows>(slot, s, Jp, GJp);
            for (int k = 0; k < kRows; ++k) GJp[k] = Wide(0) - GJp[k];
            subtract_rows(workers, slot, workspace.gradient, GJp);
          });
      return 1;
    });
  }

  /// J p and G J p of a step p; returns p'g.
  STICTION_HD_OUTLINE Wide line_products() const {
    for_each_slot(
        [&](const auto& slot, Index) {
          const Wide Jp = times_row(slot, 0, workspace.step, Wide(0));
          workspace.Jp.put(slot.row, Jp);
          workspace.GJp.put(slot.row, workspace.G_rows[slot.row] * Jp);
        },
        [&](auto shape, const auto& slot, Index s) {
          constexpr int kRows = decltype(shape)::kRows;
          Wide Jp[kRows];
          Wide GJp[kRows];
          for (int k = 0; k < kRows; ++k) Jp[k] = times_row(slot, k, workspace.step, Wide(0));
          times_hessian<kRows>(slot, s, Jp, GJp);
          for (int k = 0; k < kRows; ++k) {
            workspace.Jp.put(slot.row + k, Jp[k]);
            workspace.GJp.put(slot.row + k, GJp[k]);
          }
        });
    Wide sum(0);
    for (Index k = 0; k < tree.dofs; ++k) sum = fma_(workspace.step[k], workspace.gradient[k], sum);
    return sum;
  }

  /// Slope and curvature at v + t p of the function that is minimised. Only the difference from the quadratic model of
  /// the step is summed. It is zero where a cone stays as it was.
  struct LineSlope {
    Wide slope;
    Wide curvature;
  };
  STICTION_HD_OUTLINE LineSlope point_on_line(Wide t, Wide descent) const {
    OrderedSum<Types> slope{workspace.terms, (Wide(1) - t) * descent};
    OrderedSum<Types> curvature{workspace.terms.from(2 * Offset{counts.rows}), Wide(0) - descent};
    for_each_slot(
        [&](const auto& slot, Index s) {
          const Wide Jp = workspace.Jp[slot.row];
          const RowReaction<Wide> point = row_reaction(row_law(s), fma_(t, Jp, workspace.z[slot.row]));
          const Wide change = (workspace.x[slot.row] - point.x) - t * workspace.GJp[slot.row];
          slope.add(slot.row, change, Jp);
          curvature.add(s, (point.slope - workspace.G_rows[slot.row]) * Jp, Jp);
        },
        [&](auto shape, const auto& slot, Index s) {
          constexpr int kRows = decltype(shape)::kRows;
          const ConeLaw<Wide> law = cone_law(s);
          Wide z[kRows];
          Wide Jp[kRows];
          Wide mu[kRows];
          for (int k = 0; k < kRows; ++k) {
            mu[k] = k == 0 ? Wide(1) : workspace.mu[slot.row + k];
            Jp[k] = mu[k] * workspace.Jp[slot.row + k];
            z[k] = fma_(t, Jp[k], mu[k] * workspace.z[slot.row + k]);
          }
          const ConeReaction<Wide> point = cone_reaction(law, z[0], tangential_norm<kRows>(z));
          Wide along(0);
          Wide square(0);
          Wide before(0);
          for (int k = 1; k < kRows; ++k) {
            const Wide minus = Wide(0) - z[k];
            along = fma_(minus * point.inverse_length, Jp[k], along);
            square = fma_(Jp[k], Jp[k], square);
            const Wide raw = workspace.Jp[slot.row + k];
            const Wide x = mu[k] * (point.across * minus);
            slope.add(slot.row + k - 1, (workspace.x[slot.row + k] - x) - t * workspace.GJp[slot.row + k], raw);
            before = fma_(workspace.GJp[slot.row + k], raw, before);
          }
          slope.add(slot.row + kRows - 1, (workspace.x[slot.row] - point.x_n) - t * workspace.GJp[slot.row], Jp[0]);
          before = fma_(workspace.GJp[slot.row], Jp[0], before);
          // Jp' G Jp at the new place, less the same at the old one.
          const Wide turned = fma_(Wide(2) * point.slide * Jp[0], along, point.normal * Jp[0] * Jp[0]);
          const Wide after = fma_(point.bend * along, along, fma_(point.across, square, turned));
          curvature.add(s, after - before, Wide(1));
        });
    const LineSlope found{slope.total(counts.rows), curvature.total(counts.slots)};
    workspace.sync();  // all have added up
    return found;
  }

  /// The minimum on the line, by Newton's method in a bracket, in the lanes that move; 0 in the others.
  STICTION_HD_OUTLINE Wide search(Mask<Wide> moving, Wide descent) const {
    constexpr int kTrials = 24;
    const Wide enough = Wide(0.1) * abs_(descent);
    Wide t = select(moving, Wide(1), Wide(0));
    Wide low(0);
    Wide high(static_cast<Scalar<Wide>>(1e30));
    Mask<Wide> open = moving;
    for (int trial = 0; trial < kTrials; ++trial) {
      const LineSlope there = point_on_line(t, descent);
      open = and_(open, abs_(there.slope) > enough);
      if (!any(open)) break;
      const auto is_before = there.slope < Wide(0);
      low = select(is_before, t, low);
      high = select(is_before, high, t);
      const Wide newton = t - div_(there.slope, there.curvature);
      const auto has_end = high < Wide(static_cast<Scalar<Wide>>(1e30));
      const Wide inside = select(has_end, Wide(0.5) * (low + high), Wide(2) * low);
      const auto is_inside = and_(newton > low, newton < min_(high, Wide(16) * max_(low, Wide(1))));
      t = select(open, select(is_inside, newton, inside), t);
    }
    return t;
  }

  /// Updates v's change, z, reactions and gradient after a step of length t.
  STICTION_HD_OUTLINE void take_step(Wide t) const {
    workspace.share(tree.dofs, [&](Index k) {
      workspace.dv.put(k, fma_(t, workspace.step[k], workspace.dv[k]));
      workspace.gradient.put(k, (Wide(1) - t) * workspace.gradient[k]);
    });
    workspace.each(counts.rows, [&](Index row) {
      workspace.z.put(row, fma_(t, workspace.Jp[row], workspace.z[row]));
      workspace.model_gap.put(row, workspace.x[row] - t * workspace.GJp[row]);
    });
    refresh_reactions();
    auto&& team = workspace.team();
    for_each_in_turn(team, slots, counts.slots, [&](auto& workers, Index s) -> Index {
      with_rows(slots, s, [&](auto rows, const auto& slot) {
        constexpr int kRows = decltype(rows)::value;
        Wide amount[kRows];
        for (int k = 0; k < kRows; ++k)
          amount[k] = Wide(0) - (workspace.model_gap[slot.row + k] - workspace.x[slot.row + k]);
        subtract_rows(workers, slot, workspace.gradient, amount);
      });
      return 1;
    });
  }
};

}  // namespace stiction::inline STICTION_ISA
