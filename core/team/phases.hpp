#pragma once

#include <type_traits>

#include "core/team/team.hpp"

namespace stiction::inline STICTION_ISA {

/// True of a team of one, which computes all numbers in turn. Lanes of others compute different numbers at once.
template <class TeamT>
inline constexpr bool kIsAlone = std::is_same_v<std::remove_cvref_t<TeamT>, SerialTeam>;

/// Returns on every lane of a team where `mask` holds on all of them.
template <Team TeamT, class MaskT>
STICTION_HD MaskT on_all_lanes(TeamT& team, MaskT mask) {
  if constexpr (kIsAlone<TeamT>) {
    return mask;
  } else {
    return team.combine(mask ? 0U : 1U) == 0U;
  }
}

/// f(i) for every i in [0, n), shared out over the lanes; ends in a sync. The f(i) must not depend on each other.
template <Team TeamT, class F>
STICTION_HD void for_each(TeamT& team, Index n, F&& f) {
  for (Index i = team.rank(); i < n; i += team.size()) f(i);
  team.sync();
}

/// f(i) for every i in [0, n), shared out as for_each() does, without a sync. A lane gets the same i of every such
/// loop.
template <Team TeamT, class F>
STICTION_HD void share(TeamT& team, Index n, F&& f) {
  for (Index i = team.rank(); i < n; i += team.size()) f(i);
}

/// A count that is known to be at most kMost when a program is compiled.
template <Index kMost>
struct AtMost {
  Index count;
};

/// for_each() by a team of one, unrolled: f sees constants, so the arrays it indexes can be registers.
template <Team TeamT, Index kMost, class F>
  requires(TeamT::size() == 1)
STICTION_HD void for_each(TeamT&, AtMost<kMost> n, F&& f) {
  STICTION_UNROLL
  for (Index i = 0; i < kMost; ++i)
    if (i < n.count) f(i);
}

/// f() on one lane; ends in a sync.
template <Team TeamT, class F>
STICTION_HD void single(TeamT& team, F&& f) {
  if (team.rank() == 0) f();
  team.sync();
}

}  // namespace stiction::inline STICTION_ISA
