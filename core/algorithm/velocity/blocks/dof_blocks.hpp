#pragma once

#include "core/algorithm/velocity/blocks/block_limits.hpp"
#include "core/job/block_pattern.hpp"
#include "core/team/phases.hpp"

namespace stiction::inline STICTION_ISA {

/// An environment's degrees of freedom in blocks of up to kBodyBlock that follow one another, in the order of numbers.
/// A group of blocks may be coupled by M: blocks of two groups have no entry of M between them.
struct DofBlocks {
  Index count = 0;    ///< blocks
  Index groups = 0;   ///< of blocks
  bool fits = true;   ///< every group is within kMostGroupBlocks
  Index* first_dof;   ///< of each block                                                           (blocks + 1)
  Index* of_dof;      ///< the block of each                                                       (dofs)
  Index* group;       ///< first block of each group                                               (groups + 1)
  Index* of_block;    ///< first block of each block's group                                       (blocks)
  Index* mass_begin;  ///< first of each row's blocks of M, from its group's first to the diagonal (blocks + 1)

  /// Blocks, at most. Groups shorter than four are the last of a group, or stand between longer groups.
  static STICTION_HD constexpr Offset most(Offset dofs) { return dofs / 2 + 2; }
  static STICTION_HD constexpr Offset integers(Offset dofs) { return dofs + 4 * (most(dofs) + 1); }

  STICTION_HD DofBlocks(Index dofs, Index*& memory) {
    const auto take = [&memory](Offset size) {
      Index* const part = memory;
      memory += size;
      return part;
    };
    of_dof = take(dofs);
    first_dof = take(most(dofs) + 1);
    group = take(most(dofs) + 1);
    of_block = take(most(dofs) + 1);
    mass_begin = take(most(dofs) + 1);
  }

  [[nodiscard]] STICTION_HD Index size(Index block) const { return first_dof[block + 1] - first_dof[block]; }
  /// Returns the index of a degree of freedom in vectors of kBodyBlock numbers a block.
  [[nodiscard]] STICTION_HD Index place(Index dof) const {
    return of_dof[dof] * kBodyBlock + dof - first_dof[of_dof[dof]];
  }
  [[nodiscard]] STICTION_HD Index unknowns() const { return count * kBodyBlock; }

  /// Finds them from M's numbers. Lanes of a team hold equal copies.
  template <Team TeamT, class Real>
  STICTION_HD_OUTLINE void find(TeamT& team, const LaneEnv<Real>& env) {
    for_each(team, env.dofs, [&](Index k) { of_dof[k] = first_coupled(env, k); });
    single(team, [&] {
      // A degree of freedom begins an island if none from there on is coupled with one before.
      Index first = env.dofs;
      for (Index k = env.dofs - 1; k >= 0; --k) {
        first = of_dof[k] < first ? of_dof[k] : first;
        of_dof[k] = first >= k ? 1 : 0;
      }
      list(env.dofs);
      group[groups] = count;
      first_dof[count] = env.dofs;
    });
    count = team.broadcast([&] { return count; });
    groups = team.broadcast([&] { return groups; });
    fits = team.broadcast([&] { return fits; });
    for_each(team, count, [&](Index block) {
      for (Index k = first_dof[block]; k < first_dof[block + 1]; ++k) of_dof[k] = block;
    });
  }

 private:
  /// The first degree of freedom that M couples with `k`, of those up to it.
  template <class Real>
  static STICTION_HD Index first_coupled(const LaneEnv<Real>& env, Index k) {
    const Index begin = k - k % env.block;
    if (env.block <= kBodyBlock) return begin;
    const Real* const row = env.M + static_cast<Offset>(k) * env.block;
    for (Index column = begin; column < k; ++column)
      if (row[column - begin] != Real(0)) return column;
    return k;
  }

  /// Blocks, groups and rows of M from of_dof, which is 1 where an island begins. Islands that are short share a block.
  STICTION_HD void list(Index dofs) {
    count = groups = 0;
    Index entries = 0, room = 0;  // dofs that the last block may still take
    for (Index begin = 0; begin < dofs;) {
      Index end = begin + 1;
      while (end < dofs && of_dof[end] == 0) ++end;
      const Index length = end - begin;
      if (length <= room) {
        room -= length;
        begin = end;
        continue;
      }
      const Index first = count;
      group[groups++] = first;
      for (; begin < end; begin += kBodyBlock) {
        first_dof[count] = begin;
        of_block[count] = first;
        mass_begin[count] = entries;
        entries += ++count - first;
      }
      begin = end;
      fits = fits && count - first <= kMostGroupBlocks;
      room = length <= kBodyBlock ? kBodyBlock - length : 0;
    }
    mass_begin[count] = entries;
  }
};

}  // namespace stiction::inline STICTION_ISA
