#pragma once

#include "core/team/phases.hpp"
#include "cuda/api/kernel.hpp"

/// The environments that a warp holds, one in a slot for each of its lanes. A set of slots is the bits of an integer,
/// the same on every lane.
namespace stiction::inline STICTION_ISA {

inline constexpr Index kWarpSlots = cuda::kWarp;
/// Slots that are free before new environments are taken: while one lane loads, all others wait.
inline constexpr Index kWarpIntake = 8;
static_assert(kWarpSlots == 32, "a slot is a bit");

STICTION_HD constexpr Index count_bits(std::uint32_t bits) {
  Index count = 0;
  for (; bits != 0; bits &= bits - 1U) ++count;
  return count;
}

/// f(index) for the slots of a set, shared out; the set of those for which it was true.
template <Team TeamT, class F>
STICTION_HD std::uint32_t slots_where(TeamT& team, std::uint32_t set, F&& f) {
  std::uint32_t mine = 0;
  for (Index index = team.rank(); index < kWarpSlots; index += team.size()) {
    const std::uint32_t bit = std::uint32_t{1} << index;
    if ((set & bit) != 0 && f(index)) mine |= bit;
  }
  return team.combine(mine);
}

/// Takes environments from a queue whenever enough slots are free, and works on them until there is none.
/// start(index, position) loads the environment at a position of the queue, go_on(index) does a chunk of iterations.
/// Both return true if anything is left to do. `counter` holds how many were taken from the positions begin .. end.
template <Team TeamT, class Start, class GoOn>
STICTION_HD void work_in_slots(TeamT& team, Offset begin, Offset end, Offset* counter, Start&& start, GoOn&& go_on) {
  std::uint32_t busy = 0;
  for (bool more = true; more || busy != 0;) {
    if (const Index free = kWarpSlots - count_bits(busy); more && free >= kWarpIntake) {
      const Offset first = begin + team.fetch(counter, free);
      more = first + free < end;
      const std::uint32_t taken = ~busy;
      busy |= slots_where(team, taken, [&](Index index) {
        const Offset position = first + count_bits(taken & ((std::uint32_t{1} << index) - 1U));
        return position < end && start(index, position);
      });
    }
    busy = slots_where(team, busy, go_on);
  }
}

}  // namespace stiction::inline STICTION_ISA
