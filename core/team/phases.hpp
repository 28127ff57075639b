#pragma once

#include "core/team/team.hpp"

namespace stiction::inline STICTION_ISA {

/// f(i) for every i in [0, n), shared out over the lanes; ends in a sync. The f(i) must not depend on each other.
template <Team TeamT, class F>
STICTION_HD void for_each(TeamT& team, Index n, F&& f) {
  for (Index i = team.rank(); i < n; i += team.size()) f(i);
  team.sync();
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
