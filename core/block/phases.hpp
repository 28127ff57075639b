#pragma once

#include "core/block/block.hpp"

namespace stiction::inline STICTION_ISA {

/// f(i) for every i in [0, n), shared out over the lanes; ends in a sync. The f(i) must not depend on each other.
template <Block B, class F>
STICTION_HD void for_each(B& block, Index n, F&& f) {
  for (Index i = block.rank(); i < n; i += block.size()) f(i);
  block.sync();
}

/// f() on one lane; ends in a sync.
template <Block B, class F>
STICTION_HD void single(B& block, F&& f) {
  if (block.rank() == 0) f();
  block.sync();
}

}  // namespace stiction::inline STICTION_ISA
