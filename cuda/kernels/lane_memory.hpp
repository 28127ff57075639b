#pragma once

#include "core/algorithm/derivative/jacobian_pack_workspace.hpp"
#include "core/algorithm/velocity/solve_pack.hpp"
#include "core/base/extents.hpp"
#include "cuda/api/kernel.hpp"

namespace stiction::cuda {

/// Memory of teams of which each lane takes an environment. It is laid out for the largest one. Numbers of a team's
/// lanes lie side by side, so that lanes side by side touch addresses side by side.
struct LaneRoom {
  double* numbers;  ///< of each team                                 (teams * numbers_per_team)
  Offset* lists;    ///< of each lane of each team                    (teams * kWarp * lists_per_lane)
  Offset numbers_per_team;
  Offset lists_per_lane;
  SlotCounts largest;
  Index dofs;
  Index tree_entries;
};

/// Room for the integers of Newton's method in velocities, and its derivative, for environments of so many rows and
/// degrees of freedom, without its memory.
template <class Workspace>
LaneRoom lay_out_lanes(Index env_rows, Index env_dofs) {
  constexpr auto kOffset = static_cast<Offset>(sizeof(Offset));
  const Index rows = smaller_of(env_rows, kMostVelocityRows), dofs = smaller_of(env_dofs, kMostLargeDofs);
  const Index tree_entries = smaller_of(dofs * (dofs + 1) / 2, kMostLargeEntries);
  const SlotCounts largest = SlotCounts::most(rows, smaller_of(Offset{rows} * dofs, Offset{kMostLargeColumns}));
  const Offset small_lists = PackLists<1, DofSet>::bytes(rows),
               lists = dofs > kMostVelocityDofs ? larger_of(small_lists, PackLists<1, LargeDofSet>::bytes(rows))
                                                : small_lists;
  return {
      nullptr, nullptr,     Workspace::doubles(largest, dofs, tree_entries), (lists + kOffset - 1) / kOffset, largest,
      dofs,    tree_entries};
}

}  // namespace stiction::cuda

namespace stiction::inline STICTION_ISA {

/// A lane of a team, which takes one environment after the other.
template <class Args>
struct LanePlace {
  const Args& args;
  Offset team;
  Index lane;
  /// Integers for the parts of its environment  (islands_per_lane)
  [[nodiscard]] STICTION_HD Index* islands() const {
    return args.islands + (team * cuda::kWarp + lane) * args.islands_per_lane;
  }
};

/// Memory that a lane takes for its environment.
template <class Types>
struct LaneMemory {
  const cuda::LaneRoom& room;
  Offset team_index;
  Index lane;
  static STICTION_HD SerialTeam team() { return {}; }
  STICTION_HD void* lists(Offset) const { return room.lists + (team_index * cuda::kWarp + lane) * room.lists_per_lane; }
  template <class Lists>
  static STICTION_HD bool has_room(const Lists&, const SlotCounts&) {
    return true;
  }
  template <class Lists>
  STICTION_HD VelocityWorkspace<Types> numbers(const Lists&, const SlotCounts&) const {
    return make<VelocityWorkspace<Types>>();
  }
  template <class Lists>
  STICTION_HD JacobianPackWorkspace<Types> jacobian_pack_numbers(const Lists&, const SlotCounts&) const {
    return make<JacobianPackWorkspace<Types>>();
  }

 private:
  template <class Workspace>
  STICTION_HD Workspace make() const {
    return Workspace(room.numbers + team_index * room.numbers_per_team, room.largest, room.dofs, room.tree_entries,
                     lane);
  }
};

}  // namespace stiction::inline STICTION_ISA
