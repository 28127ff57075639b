#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "core/job/cone_counts.hpp"
#include "core/job/parallel_for.hpp"
#include "core/runtime/check/defects.hpp"
#include "core/runtime/check/diagonals.hpp"
#include "core/runtime/check/stored_columns.hpp"
#include "stiction/status.hpp"

namespace stiction {

/// Looks once at a batch whose offsets are sound, by as many threads as there are. Finds whether the batch has no
/// defect at all, as nearly every batch, and how each environment stores its columns. False means nothing: finding and
/// describing defects takes longer.
template <class Real>
class Survey {
 public:
  /// `takes_any_diagonal`: of environments without friction cones, as complementary pivoting does.
  Survey(const ContactBatchView<Real>& batch, bool with_values, bool takes_any_diagonal)
      : batch_(batch), with_values_(with_values), takes_any_diagonal_(takes_any_diagonal) {}

  bool passes(const ParallelFor& parallel_for) {
    columns_.resize(static_cast<std::size_t>(batch_.env_count));
    std::atomic<bool> passes = !with_values_ || shared_frictions_pass();
    parallel_for(batch_.env_count, [&](Offset begin, Offset end) {
      if (!part_passes(begin, end)) passes.store(false, std::memory_order_relaxed);
    });
    return passes.load();
  }
  /// Returns each environment's columns, once passes() is true.  (env_count)
  [[nodiscard]] const std::vector<StoredColumns>& columns() const { return columns_; }

 private:
  bool part_passes(Offset begin, Offset end) {
    bool passes = true;
    for (Offset env = begin; env < end && passes; ++env) passes = cones_pass(env) && columns_pass(env);
    if (!with_values_) return passes;
    passes = passes && numbers_pass(begin, end);
    for (Offset env = begin; env < end && passes; ++env) passes = flags_pass(env) && diagonal_passes(env);
    return passes;
  }

  [[nodiscard]] bool cones_pass(Offset env) const {
    const Offset row = batch_.env_row_offsets[env];
    const Offset cone = batch_.env_cone_offsets[env], end = cone + batch_.env_cones(env);
    bool passes = batch_.cone_row_offsets[cone] == row && batch_.cone_row_offsets[end] == row + rows_of(env);
    for (Offset c = cone; c < end; ++c) {
      const Offset rows = batch_.cone_row_offsets[c + 1] - batch_.cone_row_offsets[c];
      const ConeKind kind = batch_.cone_kind[c];
      passes = passes && is_cone(kind, rows) && !(batch_.normal_last && kind == ConeKind::semidefinite);
      if (passes && carries_friction(kind) && batch_.mu_offsets != nullptr) passes = mu_offsets_pass(c);
    }
    return passes;
  }

  [[nodiscard]] bool mu_offsets_pass(Offset cone) const {
    bool passes = true;
    for (Offset row = batch_.cone_row_offsets[cone]; row < batch_.cone_row_offsets[cone + 1]; ++row) {
      const Offset place = batch_.mu_offsets[row];
      passes = passes && (row == batch_.normal_row(cone) || (place >= 0 && place < batch_.mu_count));
    }
    return passes;
  }

  bool columns_pass(Offset env) {
    constexpr Offset kMostOfOneEnv = std::numeric_limits<Index>::max();
    const Offset first = batch_.env_row_offsets[env], rows = rows_of(env);
    const Offset entries = batch_.row_offsets[first + rows] - batch_.row_offsets[first];
    if (rows > kMostOfOneEnv || entries > kMostOfOneEnv) return false;
    if (batch_.normal_last && !is_dense(env, first, rows)) return false;
    const StoredColumns stored = stored_columns(batch_, first, static_cast<Index>(rows));
    columns_[static_cast<std::size_t>(env)] = stored;
    return stored != StoredColumns::any ||
           columns_below(batch_, first, static_cast<Index>(rows), static_cast<std::size_t>(entries));
  }

  /// Rows with the normal last are solved densely only.
  [[nodiscard]] bool is_dense(Offset env, Offset first, Offset rows) const {
    Offset entries = 0;
    for (Offset row = first; row < first + rows; ++row) entries += batch_.row_entries(row);
    return rows == 0 || (batch_.env_dofs(env) == 0 && choose_path(rows, entries) == EnvPath::dense);
  }

  /// Friction that rows share does not lie where their environments do.
  [[nodiscard]] bool shared_frictions_pass() const {
    return batch_.mu_offsets == nullptr ||
           all_finite_nonnegative(std::span(batch_.mu, static_cast<std::size_t>(batch_.mu_count)));
  }

  /// All numbers of some environments, unused room included.
  [[nodiscard]] bool numbers_pass(Offset begin, Offset end) const {
    const Offset first = batch_.env_row_offsets[begin];
    const auto rows = static_cast<std::size_t>(batch_.env_row_offsets[end] - first);
    const auto of_rows = [&](const Real* values) { return std::span(values + first, rows); };
    const auto within = [](const Real* values, Offset from, Offset to) {
      return std::span(values + from, static_cast<std::size_t>(to - from));
    };
    const Offset* const entry = batch_.row_offsets + first;
    return all_finite(within(batch_.A, entry[0], entry[rows])) && all_finite(of_rows(batch_.b)) &&
           all_finite_nonnegative(of_rows(batch_.R)) &&
           (batch_.mu_offsets != nullptr || all_finite_nonnegative(of_rows(batch_.mu))) &&
           all_bounds(batch_.lo + first, batch_.hi + first, rows) &&
           (batch_.factor_offsets == nullptr ||
            all_finite(within(batch_.factor, batch_.factor_offsets[begin], batch_.factor_offsets[end])));
  }

  /// Contacts without room were left out when the batch was made, and flagged: that is no defect.
  [[nodiscard]] bool flags_pass(Offset env) const {
    return batch_.env_flags == nullptr || (batch_.env_flags[env] & ~std::uint32_t{kFlagContactsDropped}) == 0;
  }

  /// A + R is positive there on every row that is not free.
  [[nodiscard]] bool diagonal_passes(Offset env) const {
    const StoredColumns stored = columns_[static_cast<std::size_t>(env)];
    const Offset first = batch_.env_row_offsets[env];
    if (stored == StoredColumns::full && has_positive_diagonal(batch_, first, static_cast<Index>(rows_of(env))))
      return true;
    if (takes_any_diagonal_ && !has_friction_cones(batch_, env)) return true;
    bool passes = true;
    const Offset cone = batch_.env_cone_offsets[env];
    for (Offset c = cone; c < cone + batch_.env_cones(env) && passes; ++c) {
      if (batch_.cone_kind[c] == ConeKind::free) continue;
      for (Offset row = batch_.cone_row_offsets[c]; row < batch_.cone_row_offsets[c + 1]; ++row)
        passes = passes && diagonal_of(batch_, env, row, stored != StoredColumns::any) > 0;
    }
    return passes;
  }

  /// Rows of an environment, which Index may not be able to count yet.
  [[nodiscard]] Offset rows_of(Offset env) const {
    return batch_.env_row_counts != nullptr ? batch_.env_row_counts[env]
                                            : batch_.env_row_offsets[env + 1] - batch_.env_row_offsets[env];
  }

  const ContactBatchView<Real>& batch_;
  bool with_values_, takes_any_diagonal_;
  std::vector<StoredColumns> columns_;
};

}  // namespace stiction
