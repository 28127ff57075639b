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

/// A lane that has finished takes the next environment before the next chunk, as the CPU's packs do.
inline LaneChunks refilled(std::span<const Index> chunks, std::size_t lanes) {
  LaneChunks total;
  std::vector<Index> left(lanes, 0);
  std::size_t next = 0;
  for (;;) {
    Offset busy = 0;
    for (Index& own : left) {
      while (own == 0 && next < chunks.size()) own = chunks[next++];
      busy += own > 0 ? 1 : 0;
    }
    if (busy == 0) return total;
    total.useful += busy;
    total.spent += static_cast<Offset>(lanes);
    for (Index& own : left) own = std::max(own - 1, 0);
  }
}

/// Sizes of cuda/kernels/solve_thread_per_env.hpp.
struct BundleShape {
  std::size_t slots = 128, intake = 32, warp = 32;
};

/// Teams that move their unfinished environments together when that frees a warp or makes room for new ones, as
/// solve_thread_per_env does. The teams take turns, a chunk each.
inline LaneChunks compacted(std::span<const Index> chunks, std::size_t teams, const BundleShape& shape = {}) {
  LaneChunks total;
  std::vector<std::vector<Index>> running(teams);  // chunks left of the environments a team works on, by position
  std::size_t next = 0;
  const auto unfinished = [](Index left) { return left > 0; };
  for (bool any = true; any;) {
    any = false;
    for (std::vector<Index>& team : running) {
      while (next < chunks.size() && team.size() + shape.intake <= shape.slots) {
        const std::size_t end = std::min(next + shape.intake, chunks.size());
        team.insert(team.end(), chunks.begin() + static_cast<std::ptrdiff_t>(next),
                    chunks.begin() + static_cast<std::ptrdiff_t>(end));
        next = end;
      }
      for (std::size_t first = 0; first < team.size(); first += shape.warp) {
        const auto warp = std::span(team).subspan(first, std::min(shape.warp, team.size() - first));
        const auto busy = std::count_if(warp.begin(), warp.end(), unfinished);
        if (busy == 0) continue;
        total.useful += busy;
        total.spent += static_cast<Offset>(shape.warp);
        for (Index& own : warp) own = std::max(own - 1, 0);
      }
      const auto rest = static_cast<std::size_t>(std::count_if(team.begin(), team.end(), unfinished));
      const auto warps = [&](std::size_t count) { return (count + shape.warp - 1) / shape.warp; };
      const bool takes_more = next < chunks.size() && rest + shape.intake <= shape.slots;
      if (warps(rest) < warps(team.size()) || takes_more) std::erase(team, 0);
      any = any || !team.empty();
    }
    any = any || next < chunks.size();
  }
  return total;
}

}  // namespace stiction::bench
