#pragma once

#include <vector>

#include "core/job/parallel_for.hpp"
#include "stiction/solver.hpp"

namespace stiction {

/// The block of each cone of a host batch whose structure is sound, by the number of the block's first cone
/// (cone_count). It is -1 in environments that are kept as a factor. Blocks are of cones of one environment, wherever
/// they stand, of up to kMostBlockRows rows. Under `strong` they follow the numbers of A, and under `pairs` none.
template <class Real>
std::vector<Index> block_groups(const ContactBatchView<Real>& batch, BlockMode mode,
                                const ParallelFor& parallel_for = all_at_once);

}  // namespace stiction
