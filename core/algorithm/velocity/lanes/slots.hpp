#pragma once

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
  Small* dof;            ///< the `dofs`, in order                            (columns)
  Small* depth;          ///< of each in the elimination tree                 (columns)
  Index row;             ///< first in arrays by row
  Index entry;           ///< first in J: rows x columns
  Index row_of[kLanes];  ///< first row within the lane's environment, -1: it has none
  Index cone_of[kLanes];
};

/// Room for the columns of slots, twice: what they are and where they are in the tree.
template <class Set>
STICTION_HD constexpr Offset column_room(Offset cones) {
  const Offset all = 2 * SetTraits<Set>::kMost * cones;
  return SetTraits<Set>::kIsWord || all < 2 * kMostLargeColumns ? all : 2 * kMostLargeColumns;
}

/// What a pack's arrays are as large as.
struct SlotCounts {
  Index slots = 0;
  Index rows = 0;
  Offset entries = 0;
  Index singles = 0;  ///< slots of one row, which come first
  bool fits = true;   ///< into the room that there is
};

/// Whether a cone goes before another. Every environment's cones have this order in every pack, so that sums over them
/// do.
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

/// How many slots from `first` on touch the same degrees of freedom, of those before `end`. Their rows lie one behind
/// the other as if they were one slot's.
template <int kLanes, class Set>
STICTION_HD Index run_of(const Slot<kLanes, Set>* slots, Index first, Index end) {
  Index last = first + 1;
  while (last < end && slots[last].dofs == slots[first].dofs) ++last;
  return last - first;
}

/// An environment's cones in that order  (env.cones).
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
  single(team, [&] {
    for (Index i = 1; i < env.cones; ++i) {
      const SlotItem<Set> item = items[i];
      Index at = i;
      for (; at > 0 && goes_before(item, items[at - 1]); --at) items[at] = items[at - 1];
      if (at < i) items[at] = item;
    }
  });
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
    Slot<kLanes, Set>& slot = slots[counts.slots++];
    slot.dofs = first->dofs;
    slot.rows = first->rows;
    slot.dof = columns;
    for_each_dof(slot.dofs, [&](Index dof) { *columns++ = static_cast<Small>(dof); });
    slot.columns = static_cast<Index>(columns - slot.dof);
    slot.depth = columns;
    columns += slot.columns;
    slot.row = counts.rows;
    slot.entry = static_cast<Index>(counts.entries);
    counts.rows += slot.rows;
    counts.singles += slot.rows == 1 ? 1 : 0;
    counts.entries += static_cast<Offset>(slot.rows) * slot.columns;
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
