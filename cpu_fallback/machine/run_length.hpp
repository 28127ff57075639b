#pragma once

#include "stiction/types.hpp"

namespace stiction::cpu {

/// Environments of `count` that a worker takes at a time, to make packs of those that are alike. With many, few cones
/// have a slot for themselves; 512 humanoids make packs with a third fewer rows than 16. With few, no worker waits
/// long for the last.
inline Offset run_length(Offset count, Index width, int workers) {
  constexpr Offset kMost = 512, kFewestPacks = 2, kRunsPerWorker = 4;
  const Offset share = workers > 1 ? count / (kRunsPerWorker * workers) : count;
  const Offset most = share < kMost ? share : kMost, packs = most / width;
  return (packs < kFewestPacks ? kFewestPacks : packs) * width;
}

}  // namespace stiction::cpu
