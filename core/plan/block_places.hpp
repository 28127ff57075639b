#pragma once

#include <vector>

#include "core/job/parallel_for.hpp"
#include "stiction/batch_structure.hpp"

namespace stiction {

/// The block_place() of each cone of a host batch, which a plan reads as its cone_group. `blocks`: as block_groups()
/// finds them. Environments that are solved densely are cut into windows of kMostBlockRows rows, which blocks fill.
std::vector<Index> block_places(const BatchStructure& batch, const std::vector<Index>& blocks,
                                const ParallelFor& parallel_for = all_at_once);

}  // namespace stiction
