#pragma once

#include "core/algorithm/velocity/iterate/velocity_newton.hpp"

/// From environments of a batch to a pack that is solved. Its memory is provided by a machine.
namespace stiction::inline STICTION_ISA {

/// Facts about a pack before its numbers are looked at: the cones that lie side by side, and the layout of its arrays.
template <int kLanes, class Set>
struct PackLists {
  using Small = typename SetTraits<Set>::Small;
  using Item = SlotItem<Set>;
  using OneSlot = Slot<kLanes, Set>;
  using Tree = DofTree<Set>;
  static constexpr Index kMost = SetTraits<Set>::kMost;
  OneSlot* slots;  ///< room for                                                            (cones)
  Small* columns;  ///< room for the slots'                                                 (column_room(cones))
  Tree* tree;      ///< behind the existing columns
  Set* coupled;    ///< degrees of freedom before each that M couples it with; until the tree is built  (kMost)
  Item* items;     ///< of all lanes, one lane after the other; until there are slots       (cones)

  /// Bytes of the lists of environments that have so many cones together.
  static STICTION_HD constexpr Offset bytes(Offset cones) {
    return early(cones) + kMost * static_cast<Offset>(sizeof(Set)) + cones * static_cast<Offset>(sizeof(Item));
  }
  /// Lists in memory of that size, aligned as an Offset is.
  template <Team TeamT>
  static STICTION_HD PackLists* in(TeamT& team, void* memory, Offset cones) {
    auto* const lists = static_cast<PackLists*>(memory);
    single(team, [&] {
      lists->slots = reinterpret_cast<OneSlot*>(lists + 1);
      lists->columns = reinterpret_cast<Small*>(lists->slots + cones);
      lists->coupled = reinterpret_cast<Set*>(static_cast<unsigned char*>(memory) + early(cones));
      lists->items = reinterpret_cast<Item*>(lists->coupled + kMost);
    });
    return lists;
  }
  /// The place that the tree is to have.
  [[nodiscard]] STICTION_HD Tree* place_for_tree(const SlotCounts& counts) {
    const Small* end = columns;
    if (counts.slots > 0) end = slots[counts.slots - 1].end();
    auto* const memory = reinterpret_cast<unsigned char*>(this);
    return reinterpret_cast<Tree*>(memory + aligned(reinterpret_cast<const unsigned char*>(end) - memory));
  }
  /// Behind the integers that are read after the tree has been built.
  [[nodiscard]] STICTION_HD const Small* end() const
    requires Tree::kIsWhole
  {
    return tree->ancestor + tree->entries;
  }
  static_assert(alignof(OneSlot) <= alignof(Offset) && alignof(Item) <= alignof(Offset));

 private:
  static STICTION_HD constexpr Offset aligned(Offset bytes) {
    constexpr Offset kAlign = alignof(Offset);
    return (bytes + kAlign - 1) / kAlign * kAlign;
  }
  static STICTION_HD constexpr Offset early(Offset cones) {
    return aligned(aligned(static_cast<Offset>(sizeof(PackLists)) + cones * static_cast<Offset>(sizeof(OneSlot)) +
                           column_room<Set>(cones) * static_cast<Offset>(sizeof(Small))) +
                   static_cast<Offset>(sizeof(Tree)));
  }
};

/// Returns true if Newton's method in velocities is cheaper for a large part than a sweep on A. A step multiplies the
/// squares of row lengths of the factor and of J, a sweep the square of A's rows. Both follow from the pattern.
template <int kLanes, class Set>
STICTION_HD bool pays_when_large(const DofTree<Set>& tree, const Slot<kLanes, Set>* slots, const SlotCounts& counts) {
  Offset step = 0;
  for (Index k = 0; k < tree.dofs; ++k) {
    const Offset width = tree.depth[k] - tree.first(k) + 1;
    step += width * width;
  }
  for (Index s = 0; s < counts.slots; ++s) step += Offset{slots[s].rows} * slots[s].columns * slots[s].columns;
  return 3 * Offset{counts.rows} * counts.rows >= step;
}

/// The cones of members of a pack, in order, where they are known; else null.
template <class Types>
using ListedCones = const SlotItem<typename Types::Set>* const*;

/// run(envs, lists, counts) for up to kLanes environments, or parts of some, each of a size that lanes take; large ones
/// alone, by memory.team(). Returns false, and calls nothing, if their lists, in memory.lists(bytes), had no
/// room.
template <class Types, class Memory, class Run>
STICTION_HD bool with_pack(const JacobianBatchView<typename Types::Real>& batch,
                           const LaneEnv<typename Types::Real>* members, Index count, Memory&& memory, Run&& run,
                           ListedCones<Types> listed = nullptr) {
  using Real = typename Types::Real;
  constexpr int kLanes = Types::kLanes;
  LaneEnv<Real> envs[kLanes];
  Index cones[kLanes] = {};
  Offset all_cones = 0;
  Index dofs = 0;
  for (Index l = 0; l < count; ++l) {
    envs[l] = members[l];
    cones[l] = envs[l].cones;
    all_cones += cones[l];
    dofs = envs[l].dofs > dofs ? envs[l].dofs : dofs;
  }
  using Set = typename Types::Set;
  using Lists = PackLists<kLanes, Set>;
  auto&& team = memory.team();
  Lists& lists = *Lists::in(team, memory.lists(Lists::bytes(all_cones)), all_cones);
  const SlotItem<Set>* items[kLanes] = {};
  SlotItem<Set>* next = lists.items;
  for_each(team, dofs, [&](Index k) { lists.coupled[k] = Set{}; });
  for (Index l = 0; l < count; ++l) {
    items[l] = listed != nullptr ? listed[l] : next;
    if (listed == nullptr) list_items(team, batch, envs[l], next);
    next += cones[l];
    add_mass_dofs(team, envs[l], lists.coupled);
  }
  SlotCounts counts;
  if constexpr (kIsAlone<decltype(team)>) {
    counts = merge_items<kLanes, Set>(items, cones, lists.slots, lists.columns);
  } else {
    counts = place_items(team, items[0], cones[0], lists.slots, lists.columns);
  }
  if (!counts.fits) return false;
  single(team, [&] { lists.tree = lists.place_for_tree(counts); });
  if (!build_tree(team, *lists.tree, dofs, lists.coupled, lists.slots, counts.slots)) return false;
  run(envs, lists, counts);
  return true;
}

/// Solves up to kLanes environments, or parts of some, each of a size that the method takes; large ones alone. The
/// outcome of each is in its `result`. memory.team() solves them together, memory.lists(bytes) is for PackLists, and
/// memory.numbers(lists, counts) makes the workspace if memory.has_room(lists, counts). `listed`: their cones, where
/// they are known.
template <class Types, class Memory>
STICTION_HD_OUTLINE void solve_pack(const VelocityJob<typename Types::Real>& job,
                                    const LaneEnv<typename Types::Real>* members, Index count, Memory&& memory,
                                    ListedCones<Types> listed = nullptr) {
  bool is_taken = false;
  with_pack<Types>(
      job.batch, members, count, memory,
      [&](const auto& envs, const auto& lists, const auto& counts) {
        if (lists.tree->dofs > kMostVelocityDofs && !pays_when_large(*lists.tree, lists.slots, counts)) return;
        if (!memory.has_room(lists, counts)) return;
        is_taken = true;
        const VelocityWorkspace<Types> workspace = memory.numbers(lists, counts);
        VelocityNewton<Types>({job, envs}, *lists.tree, lists.slots, counts, workspace).run();
      },
      listed);
  if (is_taken) return;
  for (Index l = 0; l < count; ++l) members[l].result->is_answered = false;
}

}  // namespace stiction::inline STICTION_ISA
