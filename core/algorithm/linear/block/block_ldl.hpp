#pragma once

#include "core/algorithm/linear/block/block_levels.hpp"

namespace stiction::inline STICTION_ISA {

/// The inverse of H, by a factorisation whose plan has all fill. Conjugate gradients then take one step, or two when H
/// is near singular. (H = L L' by 6 x 6 blocks; D of H = L D L' is in the diagonal blocks.)
struct BlockLdl {
  BlockFactorView plan;
  double* values = nullptr;  ///< L  (36 plan.lower.blocks())

  static constexpr Offset doubles(Offset factor_blocks) { return factor_blocks * kBlockEntries; }

  template <Team TeamT>
  STICTION_HD_OUTLINE void prepare(TeamT& team, const BlockMatrix& H) const {
    factor_levels(team, plan, H, 0.0, values);
  }
  template <Team TeamT>
  STICTION_HD_OUTLINE void apply(TeamT& team, const double* r, double* z) const {
    solve_levels(team, plan, values, r, z);
  }
};

}  // namespace stiction::inline STICTION_ISA
