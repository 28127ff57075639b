#pragma once

#include "core/algorithm/solver/lemke/minimum_ratio.hpp"

namespace stiction::inline STICTION_ISA {

/// Begins Lemke and Howson's path (1964) with label k, in a dictionary most of whose y are basic. x_k comes down from
/// infinity until a row r needs it, takes the place of y_r, and x_r that of y_k. Returns whether that was possible, on
/// every lane. If not, or if the row that needs it is that of an x, the dictionary is left as it was. Then the column
/// of y_k covers every row that such an x_r could lift. In a matrix game it so covers all that are infeasible
/// (docs/math/lemke.md).
template <Team TeamT>
STICTION_HD_OUTLINE bool begin_at_pair(TeamT& team, const Tableau& t, Index k) {
  if (t.is_basic(k)) return false;
  const Blocking last = first_blocking(team, t, k, -1.0, true);
  if (last.row < 0 || !(last.step < 0.0) || t.variable_of(last.row) < t.n) return false;
  const Index r = t.variable_of(last.row) - t.n;
  const Index row_of_k = t.row_of(t.n + k);
  if (r != k) {
    // Remainder of the entry (y_k, x_r) after the first exchange.
    const double through = div_(t.T(last.row, t.column_of(r)), t.T(last.row, t.column_of(k)));
    const double pivot = fma_(0.0 - t.T(row_of_k, t.column_of(k)), through, t.T(row_of_k, t.column_of(r)));
    if (!(abs_(pivot) > Tableau::kRelativePivot)) return false;
  }
  team.sync();
  exchange(team, t, last.row, k, 0.0 - last.step);
  if (r != k) exchange(team, t, row_of_k, r, div_(0.0 - t.value(row_of_k), t.T(row_of_k, t.column_of(r))));
  return true;
}

}  // namespace stiction::inline STICTION_ISA
