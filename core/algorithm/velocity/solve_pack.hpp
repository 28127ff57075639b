#pragma once

#include "core/algorithm/velocity/velocity_newton.hpp"

/// From environments of a batch to a pack that is solved. Where its memory comes from is a machine's affair.
namespace stiction::inline STICTION_ISA {

/// What is known of a pack before its numbers are looked at: which cones lie side by side, and how its arrays do.
template <int kLanes>
struct PackLists {
  DofTree tree;
  SlotItem* items;         ///< of all lanes, one lane after the other       (cones)
  Slot<kLanes>* slots;     ///< room for                                     (cones)
  unsigned char* columns;  ///< room for the slots'                       (kColumnBytes cones)

  /// Bytes of the lists of environments that have so many cones together.
  static STICTION_HD constexpr Offset bytes(Offset cones) {
    return static_cast<Offset>(sizeof(PackLists)) +
           cones * (static_cast<Offset>(sizeof(SlotItem) + sizeof(Slot<kLanes>)) + kColumnBytes);
  }
  /// Lists in memory of that size, aligned as an Offset is.
  static STICTION_HD PackLists* in(void* memory, Offset cones) {
    auto* const lists = static_cast<PackLists*>(memory);
    lists->items = reinterpret_cast<SlotItem*>(lists + 1);
    lists->slots = reinterpret_cast<Slot<kLanes>*>(lists->items + cones);
    lists->columns = reinterpret_cast<unsigned char*>(lists->slots + cones);
    return lists;
  }
  static_assert(alignof(Slot<kLanes>) <= alignof(DofSet) && alignof(SlotItem) <= alignof(DofSet));
};

/// Solves up to kLanes environments, or parts of some, each of a size that the method takes. What became of each is in
/// its `result`. memory.lists(bytes) is for PackLists, memory.numbers(counts, dofs, tree entries) makes the workspace.
template <class Types, class Memory>
STICTION_HD_OUTLINE void solve_pack(const VelocityJob<typename Types::Real>& job,
                                    const LaneEnv<typename Types::Real>* members, Index count, Memory&& memory) {
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
  using Lists = PackLists<kLanes>;
  Lists& lists = *Lists::in(memory.lists(Lists::bytes(all_cones)), all_cones);
  const SlotItem* items[kLanes] = {};
  SlotItem* next = lists.items;
  DofSet coupled[kMostVelocityDofs] = {};
  for (Index l = 0; l < count; ++l) {
    list_items(job.batch, envs[l], next);
    items[l] = next;
    next += cones[l];
    add_mass_dofs(envs[l], coupled);
  }
  const SlotCounts counts = merge_items<kLanes>(items, cones, lists.slots, lists.columns);
  build_tree<kLanes>(lists.tree, dofs, coupled, lists.slots, counts.slots);
  const VelocityWorkspace<Types> workspace = memory.numbers(counts, dofs, lists.tree.entries);
  VelocityNewton<Types>(job, envs, lists.tree, lists.slots, counts, workspace).run();
}

}  // namespace stiction::inline STICTION_ISA
