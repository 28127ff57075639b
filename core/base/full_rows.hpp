#pragma once

#include <cstdint>

#include "core/base/macros.hpp"
#include "stiction/types.hpp"

namespace stiction {

/// What is known of how an environment's rows are stored.
enum class FullRows : std::uint8_t {
  unknown,
  known,  ///< rows_are_full()
};

inline namespace STICTION_ISA {

/// Whether `count` columns are 0, 1, 2, ... in order.
STICTION_HD bool is_run(const Index* column, Index count) {
  unsigned off = 0;
  for (Index k = 0; k < count; ++k) off |= static_cast<unsigned>(column[k] != k);
  return off == 0;
}

/// Whether each of n rows stores all columns in order, row after row without room between, as a dense matrix written as
/// CSR does: then no column has to be looked up. Arrays begin at the environment's first row; `row_counts` may be null.
STICTION_HD bool rows_are_full(Index n, const Offset* row_offsets, const Index* row_counts,
                               const Offset* column_offsets, const Index* columns) {
  const Offset first = row_offsets[0];
  const Offset first_column = column_offsets[0];
  unsigned off = 0;
  unsigned apart = 0;
  for (Index row = 0; row < n; ++row) {
    const Offset count = row_counts != nullptr ? Offset{row_counts[row]} : row_offsets[row + 1] - row_offsets[row];
    off |= static_cast<unsigned>(row_offsets[row] - first != Offset{n} * row) | static_cast<unsigned>(count != n);
    apart |= static_cast<unsigned>(column_offsets[row] - first_column != Offset{n} * row);
  }
  if (off != 0 || !is_run(columns + first_column, n)) return false;
  if (apart != 0) {
    for (Index row = 1; row < n; ++row)
      if (!is_run(columns + column_offsets[row], n)) return false;
    return true;
  }
  // Every row's columns are those of the row before: one loop over all, and nothing left over at the end of each.
  const Index* const column = columns + first_column;
  for (Index k = n; k < n * n; ++k) off |= static_cast<unsigned>(column[k] != column[k - n]);
  return off == 0;
}

}  // namespace STICTION_ISA
}  // namespace stiction
