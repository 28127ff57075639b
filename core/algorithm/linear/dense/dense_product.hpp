#pragma once

#include "core/algorithm/linear/dense/dense_factor.hpp"

namespace stiction::inline STICTION_ISA {

/// store(i, base(i) + row i of K times in), each row summed over columns from the left by one lane.
template <Team TeamT, class Base, class Store>
STICTION_HD_OUTLINE void multiply_dense(TeamT& team, const DenseMatrix& K, const double* in, const Base& base,
                                        const Store& store) {
  constexpr Index kTile = TeamT::kRowTile;
  const Index n = K.n;
  for_each(team, (n + kTile - 1) / kTile, [&](Index tile) {
    const Index first = tile * kTile;
    const Index count = first + kTile <= n ? kTile : n - first;
    double sum[kTile];
    for (Index k = 0; k < count; ++k) sum[k] = base(first + k);
    for (Index j = 0; j < n; ++j) {
      const double factor = in[j];
      const double* const column = K.data + first + static_cast<Offset>(n) * j;
      for (Index k = 0; k < count; ++k) sum[k] = fma_(column[k], factor, sum[k]);
    }
    for (Index k = 0; k < count; ++k) store(first + k, sum[k]);
  });
}

}  // namespace stiction::inline STICTION_ISA
