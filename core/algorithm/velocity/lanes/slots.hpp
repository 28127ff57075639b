#pragma once

#include <type_traits>

#include "core/algorithm/velocity/lanes/lane_env.hpp"

/// Which cones of a pack's environments are computed side by side. Integers only (docs/math/velocity_newton.md).
namespace stiction::inline STICTION_ISA {

/// A cone of one environment.
template <class Set>
struct SlotItem {
  Set dofs;  ///< that its rows touch
  Index rows;
  Index row;   ///< its first, within the environment
  Index cone;  ///< within the environment
};

/// Cones with one number of rows that touch the same degrees of freedom, at most one of each lane.
template <int kLanes, class Set>
struct Slot {
  using Small = typename SetTraits<Set>::Small;
  Set dofs;
  Index rows;
  Index columns;         ///< how many `dofs` are
  Small* dof;            ///< the `dofs`, in order, then the depth of each in the tree  (2 columns)
  Index row;             ///< first in arrays by row
  Index entry;           ///< first in J: rows x columns
  Index row_of[kLanes];  ///< first row within the lane's environment, -1: it has none
  Index cone_of[kLanes];

  /// Gives the slot, which knows its size, the next places in arrays, and counts it.
  template <class Counts>
  STICTION_HD void take_place(Counts& counts) {
    row = counts.rows;
    entry = static_cast<Index>(counts.entries);
    ++counts.slots;
    counts.rows += rows;
    counts.singles += rows == 1 ? 1 : 0;
    counts.entries += static_cast<Offset>(rows) * columns;
  }
  [[nodiscard]] STICTION_HD Small* depth() const { return dof + columns; }
  [[nodiscard]] STICTION_HD Small* end() const { return dof + 2 * Offset{columns}; }
};

/// Room for the columns of slots, twice: their numbers and their places in the tree.
template <class Set>
STICTION_HD constexpr Offset column_room(Offset cones) {
  const Offset all = 2 * SetTraits<Set>::kMost * cones;
  return SetTraits<Set>::kIsWord || all < 2 * kMostLargeColumns ? all : 2 * kMostLargeColumns;
}

/// Sizes of a pack's arrays.
struct SlotCounts {
  Index slots = 0;
  Index rows = 0;
  Offset entries = 0;
  Index singles = 0;  ///< slots of one row, which come first
  bool fits = true;   ///< into the existing room

  /// As large as an environment of so many rows makes them at most. A friction cone has two rows or more.
  static STICTION_HD constexpr SlotCounts most(Index rows, Offset entries) {
    return {rows, rows, entries, rows - rows / 2};
  }
};

/// Returns true if a cone goes before another. Every environment's cones have this order in every pack, so that sums
/// over them do.
template <class Set>
STICTION_HD bool goes_before(const SlotItem<Set>& a, const SlotItem<Set>& b) {
  if (a.rows != b.rows) return a.rows < b.rows;
  if (!(a.dofs == b.dofs)) return a.dofs < b.dofs;
  return a.row < b.row;
}
template <class Set>
STICTION_HD bool share_a_slot(const SlotItem<Set>& a, const SlotItem<Set>& b) {
  return a.rows == b.rows && a.dofs == b.dofs;
}

/// Counts the slots from `first` on that touch the same degrees of freedom, of those before `end`. Their rows lie one
/// after another as if they were one slot's.
template <int kLanes, class Set>
STICTION_HD Index run_of(const Slot<kLanes, Set>* slots, Index first, Index end) {
  Index last = first + 1;
  while (last < end && slots[last].dofs == slots[first].dofs) ++last;
  return last - first;
}

/// f(slot, number) for rows between bounds, g(shape, slot, number) for a friction cone.
template <class SlotT, class F, class G>
STICTION_HD void visit_slot(const SlotT* slots, Index s, F&& f, G&& g) {
  if (slots[s].rows == 1) {
    f(slots[s], s);
    return;
  }
  with_shape(ConeKind::friction, slots[s].rows, [&](auto shape) {
    if constexpr (decltype(shape)::kKind == ConeKind::friction) g(shape, slots[s], s);
  });
}
/// f(kRows, slot) of a slot, its count of rows being a constant.
template <class SlotT, class F>
STICTION_HD void with_rows(const SlotT* slots, Index s, F&& f) {
  visit_slot(
      slots, s, [&](const auto& slot, Index) { f(std::integral_constant<int, 1>{}, slot); },
      [&](auto shape, const auto& slot, Index) { f(std::integral_constant<int, decltype(shape)::kRows>{}, slot); });
}

/// f(workers, s) of every slot, each after those before it that touch its degrees of freedom. Returns how many slots
/// from s on it has computed; ends in a sync. `workers` compute together. They are the team, or one of its lanes for
/// each of several slots that touch one degree of freedom each, no two the same. Such slots lie side by side, and the
/// degree of freedom grows.
template <Team TeamT, int kLanes, class Set, class F>
STICTION_HD void for_each_in_turn(TeamT& team, const Slot<kLanes, Set>* slots, Index count, F&& f) {
  if constexpr (kIsAlone<TeamT>) {
    for (Index s = 0; s < count;) s += f(team, s);
  } else {
    for (Index s = 0; s < count;) {
      const Index own = s + team.rank();
      const bool is_apart =
          own < count && slots[own].columns == 1 && (own == s || slots[own].dof[0] != slots[own - 1].dof[0]);
      const std::uint32_t others = team.combine(is_apart ? 0U : 1U << team.rank());
      const Index apart = others == 0 ? team.size() : lowest_bit(std::uint64_t{others});
      SerialTeam lane;
      if (team.rank() < apart) f(lane, own);
      s += apart > 0 ? apart : f(team, s);
      team.sync();
    }
  }
}

/// An environment's cones in that order  (env.cones). A team's are in the batch's, and merge_items() sorts them.
template <class Set, Team TeamT, class Real>
STICTION_HD void list_items(TeamT& team, const JacobianBatchView<Real>& batch, const LaneEnv<Real>& env,
                            SlotItem<Set>* items) {
  for_each(team, env.cones, [&](Index i) {
    const Index cone = cone_of(env, i);
    const Offset* const begin = batch.cone_row_offsets + env.first_cone + cone;
    SlotItem<Set> item{Set{}, static_cast<Index>(begin[1] - begin[0]), static_cast<Index>(begin[0] - env.first_row),
                       cone};
    for (Index k = 0; k < item.rows; ++k) item.dofs |= row_dofs<Set>(batch, env, item.row + k);
    items[i] = item;
  });
  if constexpr (kIsAlone<TeamT>)
    for (Index i = 1; i < env.cones; ++i) {
      const SlotItem<Set> item = items[i];
      Index at = i;
      for (; at > 0 && goes_before(item, items[at - 1]); --at) items[at] = items[at - 1];
      if (at < i) items[at] = item;
    }
}

/// Slots for the cones of an environment that a team has. Its lanes find the place of a cone each. Room as below.
template <Team TeamT, class Set>
STICTION_HD SlotCounts place_items(TeamT& team, const SlotItem<Set>* items, Index cones, Slot<1, Set>* slots,
                                   typename SetTraits<Set>::Small* columns) {
  for_each(team, cones, [&](Index i) {
    const SlotItem<Set> item = items[i];
    Index place = 0;
    for (Index other = 0; other < cones; ++other) place += goes_before(items[other], item) ? 1 : 0;
    Slot<1, Set>& slot = slots[place];
    slot.dofs = item.dofs;
    slot.rows = item.rows;
    slot.columns = size_of(item.dofs);
    slot.row_of[0] = item.row;
    slot.cone_of[0] = item.cone;
  });
  const SlotCounts counts = team.broadcast([&] {
    SlotCounts found;
    for (Index s = 0; s < cones; ++s) {
      slots[s].dof = columns;
      columns = slots[s].end();
      slots[s].take_place(found);
    }
    return found;
  });
  for_each(team, cones, [&](Index s) {
    Index c = 0;
    for_each_dof(slots[s].dofs,
                 [&](Index dof) { slots[s].dof[c++] = static_cast<typename SetTraits<Set>::Small>(dof); });
  });
  return counts;
}

/// Slots for the cones of all lanes: their lists are merged, so that each lane's cones keep their order. items[l] is
/// lane l's list, of cones[l]. Room for all cones: slots, and column_room in `columns`. Large sets may need more:
/// then `fits` is false.
template <int kLanes, class Set>
STICTION_HD SlotCounts merge_items(const SlotItem<Set>* const (&items)[kLanes], const Index (&cones)[kLanes],
                                   Slot<kLanes, Set>* slots, typename SetTraits<Set>::Small* columns) {
  using Small = typename SetTraits<Set>::Small;
  SlotCounts counts;
  Index next[kLanes] = {};
  for (;;) {
    const SlotItem<Set>* first = nullptr;
    for (int l = 0; l < kLanes; ++l) {
      if (next[l] == cones[l]) continue;
      const SlotItem<Set>* const item = items[l] + next[l];
      if (first == nullptr || (!share_a_slot(*item, *first) && goes_before(*item, *first))) first = item;
    }
    if (first == nullptr) return counts;
    if constexpr (!SetTraits<Set>::kIsWord) {
      counts.fits = counts.entries + Offset{first->rows} * size_of(first->dofs) <= kMostLargeColumns;
      if (!counts.fits) return counts;
    }
    Slot<kLanes, Set>& slot = slots[counts.slots];
    slot.dofs = first->dofs;
    slot.rows = first->rows;
    slot.dof = columns;
    for_each_dof(slot.dofs, [&](Index dof) { *columns++ = static_cast<Small>(dof); });
    slot.columns = static_cast<Index>(columns - slot.dof);
    columns = slot.end();
    slot.take_place(counts);
    const SlotItem<Set> key = *first;
    for (int l = 0; l < kLanes; ++l) {
      slot.row_of[l] = -1;
      slot.cone_of[l] = -1;
      if (next[l] == cones[l] || !share_a_slot(items[l][next[l]], key)) continue;
      slot.row_of[l] = items[l][next[l]].row;
      slot.cone_of[l] = items[l][next[l]].cone;
      ++next[l];
    }
  }
}

}  // namespace stiction::inline STICTION_ISA
