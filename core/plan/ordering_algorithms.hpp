#pragma once

#include <vector>

#include "core/job/block_pattern.hpp"

/// The orderings of order_rows, one function each; all take a square symmetric pattern.
namespace stiction {

std::vector<Index> order_cuthill_mckee(const BlockPattern& pattern);

/// Orderings of libraries; without its library each throws, and its constant is false.
extern const bool kHasEigenOrdering;
extern const bool kHasSuiteSparseOrdering;
extern const bool kHasMetisOrdering;
std::vector<Index> order_eigen(const BlockPattern& pattern);
std::vector<Index> order_suitesparse(const BlockPattern& pattern);
std::vector<Index> order_metis(const BlockPattern& pattern);

}  // namespace stiction
