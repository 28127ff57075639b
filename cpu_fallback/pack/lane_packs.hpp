#pragma once

#include "core/algorithm/derivative/jacobian_pack_workspace.hpp"
#include "core/algorithm/velocity/solve_pack.hpp"
#include "cpu_fallback/pack/alike.hpp"
#include "cpu_fallback/pack/pack_width.hpp"

/// Environments of Newton's method in velocities, and of its derivative, into packs.
namespace stiction::inline STICTION_ISA {

/// Memory of packs.
template <class Types>
struct PackMemory {
  cpu::VelocityScratch& scratch;
  static SerialTeam team() { return {}; }
  void* lists(Offset bytes) const { return scratch.lists.template reserve<char>(bytes); }
  template <class Lists>
  static bool has_room(const Lists&, const SlotCounts&) {
    return true;
  }
  template <class Lists>
  VelocityWorkspace<Types> numbers(const Lists& lists, const SlotCounts& counts) const {
    return make<VelocityWorkspace<Types>>(counts, lists.tree->dofs, lists.tree->entries);
  }
  template <class Lists>
  JacobianPackWorkspace<Types> jacobian_pack_numbers(const Lists& lists, const SlotCounts& counts) const {
    return make<JacobianPackWorkspace<Types>>(counts, lists.tree->dofs, lists.tree->entries);
  }

 private:
  template <class Workspace>
  Workspace make(const SlotCounts& counts, Index dofs, Index tree_entries) const {
    const Offset doubles = Workspace::doubles(counts, dofs, tree_entries);
    return Workspace(scratch.numbers.template reserve<double>(doubles), counts, dofs, tree_entries);
  }
};

template <class Real>
inline constexpr int kLanesHere = kSinglesAlone ? 1 : kPackWidth<Real>;

/// run.operator()<Types>(first, count) for packs of environments that follow one another, with steps in Numbers.
template <class Number, class Real, class Run>
void for_each_pack(const LaneEnv<Real>* envs, Offset count, Run&& run) {
  constexpr int kWidth = kLanesHere<Number>;
  constexpr Offset kFewest = 3;  // so few take longer in a pack than one by one
  Offset done = 0;
  if constexpr (kWidth > 1)
    for (; count - done >= kFewest; done += kWidth)
      run.template operator()<LaneTypes<Pack<Number, kWidth>, kWidth, DofSet, Real>>(
          envs + done, static_cast<Index>(count - done < kWidth ? count - done : kWidth));
  for (; done < count; ++done) run.template operator()<LaneTypes<Number, 1, DofSet, Real>>(envs + done, 1);
}

}  // namespace stiction::inline STICTION_ISA
