#pragma once

#include "core/base/macros.hpp"
#include "stiction/batch_structure.hpp"

namespace stiction::inline STICTION_ISA {

/// The batch with the totals it has now. The view gives the room of its arrays: a captured graph may be replayed with
/// less in them. Totals that make no sense are left to structure_is_sound(), which then finds the environments that
/// they break.
STICTION_HD BatchStructure with_totals(BatchStructure batch) {
  if (batch.env_count == 0) return batch;
  const auto shrink = [](Offset& room, Offset total) {
    if (total >= 0 && total < room) room = total;
  };
  if (batch.env_row_counts == nullptr || batch.ends_early) {
    shrink(batch.row_count, batch.env_row_offsets[batch.env_count]);
    shrink(batch.cone_count, batch.env_cone_offsets[batch.env_count]);
  }
  shrink(batch.nonzero_count, batch.row_offsets[batch.row_count]);
  if (batch.factor_offsets != nullptr) shrink(batch.factor_count, batch.factor_offsets[batch.env_count]);
  return batch;
}

}  // namespace stiction::inline STICTION_ISA
