#pragma once

#include <span>
#include <vector>

#include "core/job/block_factor_view.hpp"

namespace stiction {

/// Which blocks a factor keeps.
enum class Fill {
  complete,  ///< all that elimination makes: L L' = H
  none,      ///< those of H alone: incomplete Cholesky
};

/// Appends the plan of a factorisation of H to the stream (take_block_factor reads it). It has the elimination tree,
/// the pattern of L and the levels (Liu 1990; Davis 2006, chapter 4). The rows are eliminated by `order`, but rows
/// that do not depend on each other are sorted by level. No entry of L is added or lost by that. Time linear in the
/// blocks of L, up to sorting. The pattern is symmetric and has every diagonal block.
///
/// @param order  rows in the order of elimination, a permutation  (pattern.rows)
/// @throws Error(out_of_memory) when L would have more blocks than an Index counts, Error(invalid_argument) when
/// `order`
///         is no permutation or the pattern lacks a diagonal block
void append_block_factor(std::vector<Index>& stream, const BlockPattern& pattern, std::span<const Index> order,
                         Fill fill);

}  // namespace stiction
