#pragma once

#include <vector>

#include "core/graph/island_edges.hpp"

namespace stiction::graph {

struct Point {
  double x = 0, y = 0;
};

/// Beyond so many bodies all distances would take too long, and an island is laid out as a spiral.
inline constexpr std::size_t kMaxStressBodies = 512;

/// Places the bodies of an island in the plane, neighbours at a distance of about one and fixed bodies below. Sums,
/// products and square roots alone, in a fixed order: the same island is placed the same way on every machine.
std::vector<Point> place_bodies(const IslandEdges& island);

}  // namespace stiction::graph
