#pragma once

#include <span>
#include <vector>

#include "stiction/types.hpp"

namespace stiction {

/// A proper colouring of a graph: no edge joins two vertices of one colour.
struct Coloring {
  Index color_count = 0;
  std::vector<Index> color;  ///< colour of each vertex, 0..color_count-1; every colour is used  (vertex count)
};

/// Colours a graph greedily, vertices of the largest degree first (Welsh and Powell 1967), the smaller index first
/// among equals. Each gets the smallest colour that none of its neighbours has. At most max degree + 1 colours;
/// integers only, one thread: the same graph is coloured the same way everywhere.
///
/// The graph is symmetric and in CSR form: the neighbours of vertex v are
/// neighbours[offsets[v]] .. neighbours[offsets[v + 1] - 1], in any order. Time O(vertices + edges).
///
/// @param offsets     where each vertex's neighbours begin; no entries mean no vertices  (vertex count + 1)
/// @param neighbours  vertex indices; a vertex listed as its own neighbour is ignored    (2 * edge count)
Coloring color_graph(std::span<const Index> offsets, std::span<const Index> neighbours);

}  // namespace stiction
