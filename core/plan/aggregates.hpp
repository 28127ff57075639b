#pragma once

#include <vector>

#include "core/job/block_pattern.hpp"

namespace stiction {

/// Bodies joined into coarse bodies.
struct Aggregates {
  std::vector<Index> aggregate;  ///< of each body, -1 for one whose row has only the diagonal  (rows)
  std::vector<Index> root;       ///< of each aggregate, the body that it was built around
};

/// Aggregates of the graph of a symmetric pattern with its diagonal (Vanek, Mandel and Brezina 1996, algorithm 2, where
/// every entry counts as strong). First, in ascending order, a body all of whose neighbours are free becomes the root
/// of an aggregate of them all. Every body left has a neighbour that was taken, and joins the aggregate with which it
/// shares most neighbours, the lower number among equals. None hence has fewer than two members.
Aggregates find_aggregates(const BlockPattern& graph);

}  // namespace stiction
