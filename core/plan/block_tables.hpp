#pragma once

#include <algorithm>
#include <span>
#include <string>
#include <vector>

#include "core/base/extents.hpp"
#include "core/job/block_pattern.hpp"
#include "stiction/error.hpp"

/// Common parts of plans of block matrices.
namespace stiction {

/// The number of block (row, column) in the pattern, -1 if it has none.
inline Index find_block(const BlockPattern& pattern, Index row, Index column) {
  const Index* const first = pattern.columns + pattern.offsets[row];
  const Index* const last = pattern.columns + pattern.offsets[row + 1];
  const Index* const place = std::lower_bound(first, last, column);
  return place != last && *place == column ? static_cast<Index>(place - pattern.columns) : -1;
}

/// Throws unless the pattern is square and has every diagonal block.
inline void expect_diagonal(const BlockPattern& pattern) {
  if (pattern.rows != pattern.columns_total)
    throw Error(ErrorCode::invalid_argument, "pattern has " + std::to_string(pattern.rows) + " rows and " +
                                                 std::to_string(pattern.columns_total) +
                                                 " columns; a symmetric matrix has as many of both");
  for (Index row = 0; row < pattern.rows; ++row)
    if (find_block(pattern, row, row) < 0)
      throw Error(ErrorCode::invalid_argument,
                  "pattern[row " + std::to_string(row) + "] has no diagonal block; give every row one");
}

/// Appends a table of integers as take_table reads it.
inline void append_table(std::vector<Index>& stream, std::span<const Index> table) {
  stream.insert(stream.end(), table.begin(), table.end());
}

/// Appends a pattern as take_pattern reads it.
inline void append_pattern(std::vector<Index>& stream, Index columns_total, std::span<const Index> offsets,
                           std::span<const Index> columns) {
  stream.push_back(static_cast<Index>(offsets.size()) - 1);
  stream.push_back(columns_total);
  append_table(stream, offsets);
  append_table(stream, columns);
}
inline void append_pattern(std::vector<Index>& stream, const BlockPattern& pattern) {
  append_pattern(stream, pattern.columns_total, {pattern.offsets, at(pattern.rows) + 1},
                 {pattern.columns, at(pattern.blocks())});
}

/// Appends a square lower pattern by columns: offsets, the row of each block, its number in the pattern; rows
/// ascending. `has_diagonal`: they include the diagonal blocks, each the last of its row.
inline void append_columns(std::vector<Index>& stream, std::span<const Index> offsets, std::span<const Index> columns,
                           bool has_diagonal) {
  const auto rows = offsets.size() - 1;
  std::vector<Index> begin(rows + 1, 0);
  const auto visit = [&](auto&& f) {
    for (std::size_t row = 0; row < rows; ++row)
      for (Index k = offsets[row]; k < offsets[row + 1] - (has_diagonal ? 0 : 1); ++k)
        f(static_cast<Index>(row), columns[at(k)], k);
  };
  visit([&](Index, Index column, Index) { ++begin[at(column) + 1]; });
  for (std::size_t row = 0; row < rows; ++row) begin[row + 1] += begin[row];
  append_table(stream, begin);
  const auto count = at(begin[rows]);
  const std::size_t first = stream.size();
  stream.resize(first + 2 * count);
  visit([&](Index row, Index column, Index k) {
    const auto place = first + at(begin[at(column)]++);
    stream[place] = row;
    stream[place + count] = k;
  });
}

}  // namespace stiction
