#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "core/algorithm/rigid/pack_sides.hpp"
#include "core/algorithm/rigid/sequential_impulses.hpp"
#include "core/base/extents.hpp"
#include "cpu_fallback/pack/pack_driver.hpp"

/// The lanes of a pack of rigid bodies, and plan data that the pack keeps of all together.
namespace stiction::inline STICTION_ISA {

/// A lane's environment, and how far it is.
template <class Real>
struct BodyLane {
  BodyEnv<Real> env;
  SiProgress<Real> progress;
  Index left = 0;     ///< sweeps until its chunk ends
  Index substep = 0;  ///< the one that the pack has the free twists of
};

/// The sides of all lanes, once more after some lanes have another environment.
template <class Real, int W>
void write_sides(const PackSides<Real, W>& sides, const BodyLane<Real> (&lanes)[W], LaneSet busy, Index contacts) {
  for (Offset side_index = 0; side_index < 2 * Offset{contacts}; ++side_index) {
    Index slot = -1;
    bool uniform = true;
    const auto has_side = [&](int l) { return busy.has(l) && side_index < 2 * Offset{lanes[l].env.kept}; };
    for (int l = 0; l < W; ++l) {
      if (!has_side(l)) continue;
      const Index own = slot_of(lanes[l].env.side(side_index));
      if (slot < 0) slot = own;
      uniform = uniform && own == slot;
    }
    sides.is_uniform[side_index] = uniform ? 1 : 0;
    for (int l = 0; l < W; ++l) sides.side[side_index * W + l] = has_side(l) ? lanes[l].env.side(side_index) : ~slot;
  }
}

/// Writes the ends of blocks of all lanes. Each vertex of several contacts is one.
template <class Real, int W>
void write_blocks(std::vector<typename PackBlocks<Real, W>::Lanes>& ends, std::vector<Index>& longest,
                  const BodyLane<Real> (&lanes)[W], LaneSet busy) {
  std::fill(ends.begin(), ends.end(), typename PackBlocks<Real, W>::Lanes{});
  std::fill(longest.begin(), longest.end(), 0);
  busy.for_each([&](int l) {
    const BodyEnv<Real>& env = lanes[l].env;
    for (Index vertex = 0; vertex < env.color_offsets[env.color_count]; ++vertex) {
      const Index count = env.vertex_offsets[vertex + 1] - env.vertex_offsets[vertex];
      if (count == 1) continue;
      const std::size_t last = at(env.vertex_offsets[vertex + 1]) - 1;
      ends[last].count[l] = count;
      longest[last] = larger_of(longest[last], count);
    }
  });
}

}  // namespace stiction::inline STICTION_ISA
