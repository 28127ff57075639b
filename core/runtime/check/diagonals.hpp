#pragma once

#include <algorithm>
#include <cstddef>
#include <span>

#include "stiction/batch.hpp"

namespace stiction {

/// Returns true if A + R has a positive diagonal in all `rows` rows from `first` on, of an environment that stores its
/// rows in full.
template <class Real>
bool has_positive_diagonal(const ContactBatchView<Real>& batch, Offset first, Index rows) {
  const Real* const diagonal = batch.A + batch.row_offsets[first];
  bool positive = true;
  for (Index i = 0; i < rows; ++i) positive = positive && batch.R[first + i] + diagonal[Offset{rows + 1} * i] > 0;
  return positive;
}

/// Returns true if an environment has friction cones, boxed or not.
template <class Real>
bool has_friction_cones(const ContactBatchView<Real>& batch, Offset env) {
  const ConeKind* const begin = batch.cone_kind + batch.env_cone_offsets[env];
  const ConeKind* const end = begin + batch.env_cones(env);
  return std::any_of(begin, end, carries_friction);
}

/// The entry of A in that column of a row that stores columns 0, 1, 2, ...
template <class Real>
Real entry_of_run(const ContactBatchView<Real>& batch, Offset row, Index column) {
  return column < batch.row_entries(row) ? batch.A[batch.row_offsets[row] + column] : Real(0);
}

/// The entry of A in that column of any row, duplicates added up. Nearly every row stores it once, and looking for it
/// in integers vectorises, which adding floats up in their order cannot.
template <class Real>
Real entry_sum(const ContactBatchView<Real>& batch, Offset row, Index column) {
  const Offset begin = batch.row_offsets[row];
  const Index count = batch.row_entries(row);
  const Index* columns = batch.row_columns(row);
  Index hits = 0, place = 0;
  for (Index k = 0; k < count; ++k) {
    hits += columns[k] == column ? 1 : 0;
    place |= columns[k] == column ? k : 0;
  }
  if (hits == 1) return batch.A[begin + place];
  Real sum = 0;
  for (Index k = 0; hits > 0 && k < count; ++k) {
    if (columns[k] == column) sum += batch.A[begin + k];
  }
  return sum;
}

/// One row of an environment's factor, empty where A is stored.
template <class Real>
std::span<const Real> factor_row(const ContactBatchView<Real>& batch, Offset env, Offset row) {
  const auto dofs = static_cast<std::size_t>(batch.env_dofs(env));
  if (dofs == 0) return {};
  const auto own = static_cast<std::size_t>(row - batch.env_row_offsets[env]);
  return {batch.factor + batch.factor_offsets[env] + own * dofs, dofs};
}

/// The diagonal of A + R in a row of the batch, stored or of a factor. `runs`: its environment's rows store the columns
/// 0, 1, 2, ...
template <class Real>
Real diagonal_of(const ContactBatchView<Real>& batch, Offset env, Offset row, bool runs) {
  const auto own = static_cast<Index>(row - batch.env_row_offsets[env]);
  Real diagonal = batch.R[row] + (runs ? entry_of_run(batch, row, own) : entry_sum(batch, row, own));
  for (const Real value : factor_row(batch, env, row)) diagonal += value * value;
  return diagonal;
}

/// Returns true if a row of A + R is zero: it cannot move, whatever its diagonal asks for.
template <class Real>
bool is_flat(const ContactBatchView<Real>& batch, Offset env, Offset row) {
  const auto is_zero = [](std::span<const Real> values) {
    return std::all_of(values.begin(), values.end(), [](Real value) { return value == Real(0); });
  };
  const auto entries = static_cast<std::size_t>(batch.row_entries(row));
  return batch.R[row] == Real(0) && is_zero({batch.A + batch.row_offsets[row], entries}) &&
         is_zero(factor_row(batch, env, row));
}

}  // namespace stiction
