#pragma once

#include "core/algorithm/linear/block/block_levels.hpp"

namespace stiction::inline STICTION_ISA {

/// Incomplete Cholesky factorisation on H's own pattern, IC(0) by blocks (Meijerink and van der Vorst 1977): the plan
/// has no fill. After a lost pivot it begins again with H's diagonal enlarged (Manteuffel 1980). A level is one phase
/// of the triangular solves, and neighbours that follow each other make long runs of small levels: for CPUs.
struct IncompleteCholesky {
  /// A pivot below this part of its diagonal entry is the rounding of the subtracted terms.
  static constexpr double kLostPivot = 0x1p-44;
  /// First enlargement of the diagonal, and by how much the next is larger. The last, 64, is taken as it is: where a
  /// body has fewer neighbours than that, their blocks together no longer reach its diagonal.
  static constexpr double kFirstShift = 0x1p-10;
  static constexpr double kShiftGrowth = 4.0;
  static constexpr Index kAttempts = 10;

  BlockFactorView plan;
  double* values = nullptr;  ///< L  (36 plan.lower.blocks())

  static constexpr Offset doubles(Offset factor_blocks) { return factor_blocks * kBlockEntries; }

  /// Returns the enlargement of the diagonal that it took, on every lane.
  template <Team TeamT>
  STICTION_HD_OUTLINE double prepare(TeamT& team, const BlockMatrix& H) const {
    double shift = 0.0;
    for (Index attempt = 1;; ++attempt) {
      factor_levels(team, plan, H, shift, values);
      if (attempt == kAttempts || !has_lost_pivot(team, H, shift)) return shift;
      shift = attempt == 1 ? kFirstShift : shift * kShiftGrowth;
    }
  }
  template <Team TeamT>
  STICTION_HD_OUTLINE void apply(TeamT& team, const double* r, double* z) const {
    solve_levels(team, plan, values, r, z);
  }

 private:
  /// A pivot that factor_block replaced is far above the diagonal entry that it is left of.
  template <Team TeamT>
  STICTION_HD_OUTLINE bool has_lost_pivot(TeamT& team, const BlockMatrix& H, double shift) const {
    std::uint32_t lost = 0;
    for (Index row = team.rank(); row < plan.rows; row += team.size()) {
      const Index pivot = plan.lower.offsets[row + 1] - 1;
      for (Index k = 0; k < kBlockEntries; k += kBodyBlock + 1) {
        const double root = values[static_cast<Offset>(pivot) * kBlockEntries + k];
        const double entry = H.block(plan.sources[pivot])[k];
        const double left = root * root;
        if (!(left > kLostPivot * entry) || !(left <= (2.0 + shift) * entry)) lost = 1;
      }
    }
    return team.combine(lost) != 0;
  }
};

}  // namespace stiction::inline STICTION_ISA
