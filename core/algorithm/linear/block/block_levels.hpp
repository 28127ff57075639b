#pragma once

#include "core/algorithm/linear/block/block_algebra.hpp"
#include "core/job/block_factor_view.hpp"

/// Cholesky's factorisation of a block matrix by the levels of its plan, complete or not as the plan's pattern is. It
/// is left-looking: one lane computes a block of L after lower levels, contributions in ascending column. (Davis 2006,
/// section 4.8; levels: Anderson and Saad 1989.)
namespace stiction::inline STICTION_ISA {

/// Team `below` of L in row `row`: H's block less the products of L's rows to its left, divided by its column's
/// diagonal.
STICTION_HD void factor_below(const BlockFactorView& plan, const BlockMatrix& H, Index row, Index below,
                              double* values) {
  const BlockPattern& L = plan.lower;
  const Index column = L.columns[below];
  const Index pivot = L.offsets[column + 1] - 1;
  double* const K = values + static_cast<Offset>(below) * kBlockEntries;
  load_block(H, plan.sources[below], K);
  Index a = L.offsets[row];
  Index b = L.offsets[column];
  while (a < below && b < pivot) {
    const Index left = L.columns[a];
    const Index right = L.columns[b];
    if (left == right)
      subtract_outer(values + static_cast<Offset>(a) * kBlockEntries, values + static_cast<Offset>(b) * kBlockEntries,
                     K);
    a += left <= right ? 1 : 0;
    b += right <= left ? 1 : 0;
  }
  divide_by_transpose(values + static_cast<Offset>(pivot) * kBlockEntries, K);
}

/// The diagonal block of L in row `row`; H's own diagonal is enlarged by the factor 1 + shift.
STICTION_HD void factor_pivot(const BlockFactorView& plan, const BlockMatrix& H, Index row, double shift,
                              double* values) {
  const Index pivot = plan.lower.offsets[row + 1] - 1;
  double* const K = values + static_cast<Offset>(pivot) * kBlockEntries;
  load_block(H, plan.sources[pivot], K);
  for (Index i = 0; i < kBodyBlock; ++i) {
    const double entry = K[i * kBodyBlock + i];
    K[i * kBodyBlock + i] = fma_(shift, entry, entry);
  }
  for (Index k = plan.lower.offsets[row]; k < pivot; ++k) {
    const double* const F = values + static_cast<Offset>(k) * kBlockEntries;
    subtract_outer(F, F, K);
  }
  factor_block(K);
}

/// L into `values`, in the order of plan.lower's blocks.
template <Team TeamT>
STICTION_HD_OUTLINE void factor_levels(TeamT& team, const BlockFactorView& plan, const BlockMatrix& H, double shift,
                                       double* values) {
  for (Index level = 0; level < plan.level_count; ++level) {
    const Index first = plan.level_offsets[level];
    const Index end = plan.level_offsets[level + 1];
    for_each(team, end - first, [&](Index k) { factor_pivot(plan, H, first + k, shift, values); });
    const Index first_below = plan.column_offsets[first];
    for_each(team, plan.column_offsets[end] - first_below, [&](Index k) {
      factor_below(plan, H, plan.column_rows[first_below + k], plan.column_blocks[first_below + k], values);
    });
  }
}

/// z = (L L')^-1 r, both in H's order of rows.
template <Team TeamT>
STICTION_HD_OUTLINE void solve_levels(TeamT& team, const BlockFactorView& plan, const double* values, const double* r,
                                      double* z) {
  const BlockPattern& L = plan.lower;
  for (Index level = 0; level < plan.level_count; ++level) {
    const Index first = plan.level_offsets[level];
    for_each(team, plan.level_offsets[level + 1] - first, [&](Index k) {
      const Index row = first + k;
      const Index pivot = L.offsets[row + 1] - 1;
      const Offset place = static_cast<Offset>(plan.order[row]) * kBodyBlock;
      double v[kBodyBlock];
      for (Index i = 0; i < kBodyBlock; ++i) v[i] = r[place + i];
      for (Index b = L.offsets[row]; b < pivot; ++b)
        subtract_image(values + static_cast<Offset>(b) * kBlockEntries,
                       z + static_cast<Offset>(plan.order[L.columns[b]]) * kBodyBlock, v);
      solve_lower(values + static_cast<Offset>(pivot) * kBlockEntries, v);
      for (Index i = 0; i < kBodyBlock; ++i) z[place + i] = v[i];
    });
  }
  for (Index level = plan.level_count - 1; level >= 0; --level) {
    const Index first = plan.level_offsets[level];
    for_each(team, plan.level_offsets[level + 1] - first, [&](Index k) {
      const Index column = first + k;
      const Offset place = static_cast<Offset>(plan.order[column]) * kBodyBlock;
      double v[kBodyBlock];
      for (Index i = 0; i < kBodyBlock; ++i) v[i] = z[place + i];
      for (Index b = plan.column_offsets[column]; b < plan.column_offsets[column + 1]; ++b)
        subtract_transposed_image(values + static_cast<Offset>(plan.column_blocks[b]) * kBlockEntries,
                                  z + static_cast<Offset>(plan.order[plan.column_rows[b]]) * kBodyBlock, v);
      solve_upper(values + static_cast<Offset>(L.offsets[column + 1] - 1) * kBlockEntries, v);
      for (Index i = 0; i < kBodyBlock; ++i) z[place + i] = v[i];
    });
  }
}

}  // namespace stiction::inline STICTION_ISA
