#pragma once

#include "core/algorithm/velocity/lanes/dof_tree.hpp"
#include "core/algorithm/velocity/lanes/lane_array.hpp"
#include "core/base/extents.hpp"

namespace stiction::inline STICTION_ISA {

template <class Types>
using SlotOf = Slot<Types::kLanes, typename Types::Set>;
template <class Types>
using TreeOf = DofTree<typename Types::Set>;
template <class Types>
using SmallOf = typename SetTraits<typename Types::Set>::Small;

/// Scratch of one pack, in numbers: arrays by row of a slot, by slot, by degree of freedom, by entry of J and of M.
template <class Types>
struct VelocityWorkspace {
  using Number = typename Types::Number;
  using Numbers = typename Types::Numbers;
  using Team = typename Types::Team;
  static constexpr Index kStride = Types::kStride;
  /// Three evaluations are kept of each: the terms that the answer has, and their difference from those it was found
  /// with.
  static constexpr Index kSlips = 6;
  static constexpr Index kDouble = sizeof(Number) == sizeof(double) ? 1 : 2;

  Numbers J;              ///< rows x columns of each slot                           (entries)
  Numbers z;              ///< J v - target + shift                                  (rows)
  Numbers x;              ///< reactions                                             (rows)
  Numbers Jp;             ///< J times the step                                      (rows)
  Numbers GJp;            ///< G J times the step                                    (rows)
  Numbers model_gap;      ///< reactions less the quadratic model's                  (rows)
  Numbers target;         ///<                                                       (rows)
  Numbers shift;          ///< de Saxce's and proximal terms                         (rows)
  Numbers mu;             ///< of tangential rows; 1 in others                       (rows)
  Numbers R;              ///<                                                       (rows)
  Numbers prox_center;    ///< reactions that the proximal term holds on to          (rows)
  Numbers prox;           ///< addition to R                                         (rows)
  Numbers G_rows;         ///< G by rows: slope of the first, direction of -z_t      (rows)
  Numbers law;            ///< RowLaw or ConeLaw                                     (3 slots)
  Numbers G_cones;        ///< G by friction cones: across, slide, bend              (3 cones)
  Numbers dv;             ///< sum of the steps since v was written down             (dofs)
  Numbers v_free;         ///<                                                       (dofs)
  Numbers gradient;       ///<                                                       (dofs)
  Numbers step;           ///<                                                       (dofs)
  Numbers inverse;        ///< of H's pivots                                         (dofs)
  Numbers mobility;       ///< of M's pivots                                         (dofs)
  Numbers M;              ///<                                                       (tree entries)
  Numbers H;              ///<                                                       (tree entries)
  double* v;              ///< velocity                                              (dofs; lanes)
  double* factor;         ///< of M, in double                                       (tree entries; lanes)
  double* pivot;          ///< inverse pivots of M                                   (dofs; lanes)
  double* diagonal;       ///< of A, row by row of a cone, scaled                    (rows; lanes)
  double* velocity;       ///< v_free + M^-1 J' x                                    (dofs; lanes)
  double* scratch;        ///<                                                       (dofs; lanes)
  double* force;          ///<                                                       (dofs; lanes)
  double* motion;         ///< of the reactions' rows                                (rows; lanes)
  double* axis_press;     ///< ConeMetric's weights of rows                          (rows; lanes)
  double* axis_slip;      ///<                                                       (rows; lanes)
  double* error_unit;     ///< ErrorScale::unit                                      (1; lanes)
  double* share_of;       ///< of each cone's island, over the largest error scale   (slots; lanes)
  double* slip;           ///< de Saxce's terms of the last evaluations              (kSlips; friction cones; lanes)
  Numbers terms;          ///< of ordered sums, factors side by side; teams alone    (2 rows + 2 slots)
  Team* lanes = nullptr;  ///< that own the pack together; null: one

  /// Rows of J by depth: three, or one for each of a team's lanes. They lie over arrays that are written once the
  /// diagonal is known.
  [[nodiscard]] STICTION_HD double* rows_by_depth() const { return velocity; }
  /// Motion that reactions of zero leave; no step has been made where it is read.
  [[nodiscard]] STICTION_HD const Numbers& free_motion() const { return model_gap; }

  /// The team; a pack's has one lane.
  [[nodiscard]] STICTION_HD decltype(auto) team() const {
    if constexpr (kIsAlone<Team>) {
      return SerialTeam{};
    } else {
      return (*lanes);
    }
  }
  /// f(i) for every i in [0, n), shared out over the team; ends in a sync.
  template <class F>
  STICTION_HD void each(Index n, F&& f) const {
    auto&& own = team();
    for_each(own, n, f);
  }
  /// each() without its sync. A lane gets the same i of every such loop.
  template <class F>
  STICTION_HD void share(Index n, F&& f) const {
    auto&& own = team();
    STICTION_ISA::share(own, n, f);
  }
  STICTION_HD void sync() const {
    auto&& own = team();
    own.sync();
  }
  /// f() on one lane; ends in a sync.
  template <class F>
  STICTION_HD void once(F&& f) const {
    auto&& own = team();
    single(own, f);
  }
  /// on_all_lanes() of the team.
  template <class MaskT>
  [[nodiscard]] STICTION_HD MaskT all(MaskT mask) const {
    auto&& own = team();
    return on_all_lanes(own, mask);
  }
  /// The largest of the team's numbers, on every lane.
  template <class Value>
  [[nodiscard]] STICTION_HD Value largest(Value value) const {
    auto&& own = team();
    return own.max(value);
  }

  /// Doubles that a workspace takes. `by_depth`: of rows_by_depth(), if it is more than a pack's.
  static STICTION_HD constexpr Offset doubles(const SlotCounts& counts, Index dofs, Index tree_entries,
                                              Offset by_depth = 0) {
    const Offset rows = counts.rows, slots = counts.slots, cones = counts.slots - counts.singles;
    const Offset numbers = counts.entries + 12 * rows + 3 * slots + 3 * cones + 6 * Offset{dofs} +
                           2 * Offset{tree_entries} + term_count(counts);
    const Offset late = 3 * Offset{dofs} + 3 * rows + 1 + slots + kSlips * cones;
    const Offset wide = Offset{tree_entries} + 2 * Offset{dofs} + rows + larger_of(late, by_depth);
    return kStride * (wide + (numbers + kDouble - 1) / kDouble);
  }

  /// `lane`: which of kStride lanes that share the memory; 0 for a pack.
  STICTION_HD VelocityWorkspace(double* memory, const SlotCounts& counts, Index dofs, Index tree_entries,
                                Index lane = 0, Offset by_depth = 0) {
    const auto take_doubles = [&memory, lane](Offset count) {
      double* const part = memory + lane;
      memory += count * kStride;
      return part;
    };
    const Offset cones = counts.slots - counts.singles;
    factor = take_doubles(tree_entries);
    v = take_doubles(dofs);
    pivot = take_doubles(dofs);
    diagonal = take_doubles(counts.rows);
    double* const late = memory;
    velocity = take_doubles(dofs);
    scratch = take_doubles(dofs);
    force = take_doubles(dofs);
    motion = take_doubles(counts.rows);
    axis_press = take_doubles(counts.rows);
    axis_slip = take_doubles(counts.rows);
    error_unit = take_doubles(1);
    share_of = take_doubles(counts.slots);
    slip = take_doubles(kSlips * cones);
    if (memory < late + by_depth * kStride) memory = late + by_depth * kStride;
    Number* rest = reinterpret_cast<Number*>(memory);
    const auto take = [&rest, lane](Offset count) {
      const Numbers part{rest + lane};
      rest += count * kStride;
      return part;
    };
    J = take(counts.entries);
    for (Numbers* part : {&z, &x, &Jp, &GJp, &model_gap, &target, &shift, &mu, &R, &prox_center, &prox, &G_rows})
      *part = take(counts.rows);
    law = take(3 * Offset{counts.slots});
    G_cones = take(3 * cones);
    for (Numbers* part : {&dv, &v_free, &gradient, &step, &inverse, &mobility}) *part = take(dofs);
    for (Numbers* part : {&M, &H}) *part = take(tree_entries);
    terms = take(term_count(counts));
  }

 private:
  static STICTION_HD constexpr Offset term_count(const SlotCounts& counts) {
    return kIsAlone<Team> ? 0 : 2 * (Offset{counts.rows} + Offset{counts.slots});
  }
};

}  // namespace stiction::inline STICTION_ISA
