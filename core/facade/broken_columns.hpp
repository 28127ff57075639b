#pragma once

#include <algorithm>
#include <vector>

#include "core/base/extents.hpp"
#include "core/runtime/check/stored_columns.hpp"
#include "stiction/batch.hpp"
#include "stiction/status.hpp"

namespace stiction {

/// A batch for machines, which follow columns without checking them. Environments with a column out of range get
/// columns that are in range, and the flag that keeps them from being solved. The offsets must be sound. Copies nothing
/// where all columns are in range.
template <class Real>
class BrokenColumns {
 public:
  explicit BrokenColumns(const ContactBatchView<Real>& batch) : view_(batch) {
    for (Offset env = 0; env < batch.env_count; ++env) {
      const Offset first = batch.env_row_offsets[env];
      const Index rows = batch.env_rows(env);
      const auto entries = static_cast<std::size_t>(batch.row_offsets[first + rows] - batch.row_offsets[first]);
      if (columns_below(batch, first, rows, entries)) continue;
      copy_once();
      env_flags_[static_cast<std::size_t>(env)] |= kFlagBadStructure;
      for (Offset row = first; row < first + rows; ++row) column_offsets_[static_cast<std::size_t>(row)] = zeros_;
    }
  }
  BrokenColumns(const BrokenColumns&) = delete;
  BrokenColumns& operator=(const BrokenColumns&) = delete;

  [[nodiscard]] const ContactBatchView<Real>& view() const { return view_; }

 private:
  /// Rows of sound environments keep the columns they have, which they may share; broken ones find zeros behind those.
  void copy_once() {
    if (!env_flags_.empty()) return;
    const auto envs = static_cast<std::size_t>(view_.env_count), rows = static_cast<std::size_t>(view_.row_count);
    env_flags_.resize(envs);
    if (view_.env_flags != nullptr) std::copy_n(view_.env_flags, envs, env_flags_.begin());
    zeros_ = view_.columns_stored();
    Index longest = 0;
    for (Offset row = 0; row < view_.row_count; ++row) longest = larger_of(longest, view_.row_entries(row));
    column_.assign(static_cast<std::size_t>(zeros_ + longest), 0);
    std::copy_n(view_.column, zeros_, column_.begin());
    column_offsets_.resize(rows);
    std::copy_n(view_.column_offsets != nullptr ? view_.column_offsets : view_.row_offsets, rows,
                column_offsets_.begin());
    view_.env_flags = env_flags_.data();
    view_.column = column_.data();
    view_.column_offsets = column_offsets_.data();
    view_.column_count = static_cast<Offset>(column_.size());
  }

  ContactBatchView<Real> view_;
  std::vector<std::uint32_t> env_flags_;
  std::vector<Index> column_;
  std::vector<Offset> column_offsets_;
  Offset zeros_ = 0;  ///< where in column_ they begin
};

}  // namespace stiction
