#pragma once

#include <cstdint>

#include "core/base/macros.hpp"
#include "stiction/types.hpp"

namespace stiction {

/// Knowledge of how an environment's rows are stored.
enum class FullRows : std::uint8_t {
  unknown,
  known,  ///< rows_are_full()
};

inline namespace STICTION_ISA {

/// Returns true if `count` columns are 0, 1, 2, ... in order.
STICTION_HD bool is_run(const Index* column, Index count) {
  Index off = 0;
  for (Index k = 0; k < count; ++k) off |= column[k] ^ k;
  return off == 0;
}

/// Returns true if each of n rows stores all columns in order, row after row without room between, as CSR of a dense
/// matrix does. Then no column has to be looked up. Arrays begin at the environment's first row; `row_counts` may be
/// null.
STICTION_HD bool rows_are_full(Index n, const Offset* row_offsets, const Index* row_counts,
                               const Offset* column_offsets, const Index* columns) {
  const Offset first = row_offsets[0];
  const Offset first_column = column_offsets[0];
  // Differences are gathered bit by bit: that vectorises where comparing 64-bit numbers does not.
  Offset off = 0;
  Offset apart = 0;
  for (Index row = 0; row < n; ++row) {
    off |= (row_offsets[row] - first) ^ (Offset{n} * row);
    apart |= (column_offsets[row] - first_column) ^ (Offset{n} * row);
  }
  if (row_counts == nullptr) {
    off |= (row_offsets[n] - first) ^ (Offset{n} * n);
  } else {
    for (Index row = 0; row < n; ++row) off |= row_counts[row] ^ n;
  }
  if (off != 0 || !is_run(columns + first_column, n)) return false;
  if (apart != 0) {
    for (Index row = 1; row < n; ++row)
      if (!is_run(columns + column_offsets[row], n)) return false;
    return true;
  }
  // Every row's columns are those of the row before: one loop over all, and nothing left over at the end of each.
  const Index* const column = columns + first_column;
  Index changed = 0;
  for (Index k = n; k < n * n; ++k) changed |= column[k] ^ column[k - n];
  return changed == 0;
}

}  // namespace STICTION_ISA
}  // namespace stiction
