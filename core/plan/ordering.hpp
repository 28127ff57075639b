#pragma once

#include <vector>

#include "core/job/block_pattern.hpp"
#include "stiction/ordering.hpp"

namespace stiction {

/// The rows of a symmetric pattern in the order in which to eliminate them: entry k is the k-th row. Depends on the
/// pattern alone. Throws Error(unsupported) that names the package when this build lacks the library, and
/// Error(invalid_argument) for a pattern that is not square.
std::vector<Index> order_rows(const BlockPattern& pattern, Ordering ordering);

}  // namespace stiction
