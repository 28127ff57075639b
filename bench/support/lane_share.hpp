#pragma once

#include <algorithm>
#include <cstddef>
#include <span>
#include <vector>

#include "stiction/types.hpp"

/// How much of what lanes in lock-step do serves an unfinished environment, when environments stop at different
/// counts. It is counted, not timed. `chunks` are the chunks that each environment takes, in the order in which they
/// are taken. A warp, or a pack of lanes, spends a chunk on all its lanes as long as one of them has something to do.
namespace stiction::bench {

/// Lane-chunks that were spent, and those among them that an environment needed.
struct LaneChunks {
  Offset spent = 0;
  Offset useful = 0;
  [[nodiscard]] double share() const {
    return spent == 0 ? 1.0 : static_cast<double>(useful) / static_cast<double>(spent);
  }
};

/// Warps that keep their environments to the end.
inline LaneChunks lock_step(std::span<const Index> chunks, std::size_t warp) {
  LaneChunks total;
  for (std::size_t first = 0; first < chunks.size(); first += warp) {
    const auto members = chunks.subspan(first, std::min(warp, chunks.size() - first));
    Index longest = 0;
    for (const Index own : members) {
      longest = std::max(longest, own);
      total.useful += own;
    }
    total.spent += static_cast<Offset>(warp) * longest;
  }
  return total;
}

/// Once `intake` lanes have finished, they take the next environments before the next chunk. It is one in the CPU's
/// packs, and several in a GPU's warps (cuda/kernels/warp_slots.hpp).
inline LaneChunks refilled(std::span<const Index> chunks, std::size_t lanes, std::size_t intake = 1) {
  LaneChunks total;
  std::vector<Index> left(lanes, 0);
  std::size_t next = 0;
  for (;;) {
    const auto free = static_cast<std::size_t>(std::count(left.begin(), left.end(), 0));
    for (Index& own : left)
      while (free >= intake && own == 0 && next < chunks.size()) own = chunks[next++];
    const auto busy = static_cast<Offset>(lanes) - std::count(left.begin(), left.end(), 0);
    if (busy == 0) return total;
    total.useful += busy;
    total.spent += static_cast<Offset>(lanes);
    for (Index& own : left) own = std::max(own - 1, 0);
  }
}

}  // namespace stiction::bench
