#pragma once

#include <vector>

#include "stiction/batch.hpp"

namespace stiction {

/// Finds which cones of each environment act on one another, however indirectly. Two that a stored entry joins, either
/// way round and whatever its value, are in one island. Neighbouring cones of one non-negative group are joined, too.
struct Islands {
  std::vector<Index> island;  ///< of each cone, numbered 0, 1, ... in its environment by their first cones; 0 in room
                              ///< that no cone uses                                                  (cone_count)
  std::vector<Index> count;   ///< islands of each environment                                               (env_count)
};

/// Finds the islands of a host batch whose structure is sound, in time all but proportional to its entries. From
/// integers alone, each environment's from its own.
Islands find_islands(const BatchStructure& batch);

}  // namespace stiction
