#pragma once

#include <cstdint>
#include <span>

#include "core/base/dense_rows.hpp"
#include "stiction/batch_structure.hpp"

namespace stiction {

/// Kind of an environment's stored columns.
enum class StoredColumns : std::uint8_t {
  any,
  run,   ///< each row columns 0, 1, 2, ... in order, all of its own then
  full,  ///< and all there are: rows_are_full()
};

/// Returns the columns of `rows` rows from `first` on, whose offsets are sound.
inline StoredColumns stored_columns(const BatchStructure& batch, Offset first, Index rows) {
  if (rows == 0) return StoredColumns::run;
  const Index* const counts = batch.row_counts == nullptr ? nullptr : batch.row_counts + first;
  const Offset* const offsets = batch.row_offsets + first;
  const Offset* const columns = batch.column_offsets == nullptr ? offsets : batch.column_offsets + first;
  if (rows_are_full(rows, offsets, counts, columns, batch.column)) return StoredColumns::full;
  for (Offset row = first; row < first + rows; ++row) {
    const Index count = batch.row_entries(row);
    if (count > rows || !is_run(batch.row_columns(row), count)) return StoredColumns::any;
  }
  return StoredColumns::run;
}

/// Returns true if every index is in 0..bound-1, without a branch: a negative one is a large unsigned one.
inline bool all_below(std::span<const Index> indices, Index bound) {
  std::uint32_t any = 0;
  for (const Index index : indices) {
    any |= static_cast<std::uint32_t>(index) >= static_cast<std::uint32_t>(bound) ? 1U : 0U;
  }
  return any == 0;
}

/// True if the columns of an environment's rows are all of its own. Rows that follow one another are read as one.
inline bool columns_below(const BatchStructure& batch, Offset first, Index rows, std::size_t entries) {
  if (batch.row_counts == nullptr && batch.column_offsets == nullptr)
    return all_below(std::span(batch.row_columns(first), entries), rows);
  bool sound = true;
  for (Offset row = first; row < first + rows; ++row) {
    sound =
        sound && all_below(std::span(batch.row_columns(row), static_cast<std::size_t>(batch.row_entries(row))), rows);
  }
  return sound;
}

}  // namespace stiction
