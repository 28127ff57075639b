#pragma once

#include <vector>

#include "core/job/sparse_inverse_view.hpp"

namespace stiction {

/// Appends the plan of a factored approximate inverse of H to the stream (take_sparse_inverse reads it). The pattern is
/// symmetric and has every diagonal block, else Error(invalid_argument).
void append_sparse_inverse(std::vector<Index>& stream, const BlockPattern& pattern);

}  // namespace stiction
