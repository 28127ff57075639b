#pragma once

#include "stiction/batch.hpp"

namespace stiction {

/// Whether A + R has a positive diagonal in all `rows` rows from `first` on, of an environment that stores its rows in
/// full.
template <class Real>
bool has_positive_diagonal(const ContactBatchView<Real>& batch, Offset first, Index rows) {
  const Real* const diagonal = batch.A + batch.row_offsets[first];
  bool positive = true;
  for (Index i = 0; i < rows; ++i) positive = positive && batch.R[first + i] + diagonal[Offset{rows + 1} * i] > 0;
  return positive;
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

}  // namespace stiction
