#pragma once

#include "core/team/team.hpp"

namespace stiction::inline STICTION_ISA {

/// f(i) for every i in [0, n), shared out over the lanes; ends in a sync. The f(i) must not depend on each other.
template <Block B, class F>
STICTION_HD void for_each(B& block, Index n, F&& f) {
  for (Index i = block.rank(); i < n; i += block.size()) f(i);
  block.sync();
}

/// A count that is known to be at most kMost when a program is compiled.
template <Index kMost>
struct AtMost {
  Index count;
};

/// The same for a block of one, unrolled: f sees constants, so the arrays it indexes can be registers.
template <Block B, Index kMost, class F>
requires(B::size() == 1) STICTION_HD void for_each(B&, AtMost<kMost> n, F&& f) {
  STICTION_UNROLL
  for (Index i = 0; i < kMost; ++i)
    if (i < n.count) f(i);
}

/// f() on one lane; ends in a sync.
template <Block B, class F>
STICTION_HD void single(B& block, F&& f) {
  if (block.rank() == 0) f();
  block.sync();
}

}  // namespace stiction::inline STICTION_ISA
