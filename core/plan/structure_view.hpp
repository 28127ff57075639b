#pragma once

#include "stiction/batch.hpp"

namespace stiction {

/// The integers of a batch without its numbers, which are null: what is planned from it cannot depend on a value or a
/// precision.
template <class Real>
ContactBatchView<float> structure_view(const ContactBatchView<Real>& batch) {
  ContactBatchView<float> integers;
  integers.env_count = batch.env_count;
  integers.cone_count = batch.cone_count;
  integers.row_count = batch.row_count;
  integers.nonzero_count = batch.nonzero_count;
  integers.env_row_offsets = batch.env_row_offsets;
  integers.env_cone_offsets = batch.env_cone_offsets;
  integers.env_row_counts = batch.env_row_counts;
  integers.env_cone_counts = batch.env_cone_counts;
  integers.env_flags = batch.env_flags;
  integers.env_tolerance = batch.env_tolerance;
  integers.env_max_iterations = batch.env_max_iterations;
  integers.cone_kind = batch.cone_kind;
  integers.cone_row_offsets = batch.cone_row_offsets;
  integers.cone_group = batch.cone_group;
  integers.row_offsets = batch.row_offsets;
  integers.row_counts = batch.row_counts;
  integers.column = batch.column;
  integers.column_offsets = batch.column_offsets;
  integers.column_count = batch.column_count;
  integers.factor_offsets = batch.factor_offsets;
  integers.factor_count = batch.factor_count;
  integers.mu_offsets = batch.mu_offsets;
  integers.mu_count = batch.mu_count;
  integers.normal_last = batch.normal_last;
  integers.ends_early = batch.ends_early;
  integers.law = batch.law;
  integers.space = batch.space;
  return integers;
}

}  // namespace stiction
