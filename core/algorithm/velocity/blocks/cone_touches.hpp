#pragma once

#include "core/algorithm/velocity/blocks/dof_blocks.hpp"
#include "core/team/scan.hpp"

namespace stiction::inline STICTION_ISA {

/// Which blocks of degrees of freedom each cone touches, and J there. A touch is a cone and a block. Touches of a cone
/// follow one another in the order of blocks, those of a block are listed in the order of cones. The same holds for
/// every sum over them.
struct ConeTouches {
  Index cones = 0;
  Index count = 0;   ///< touches
  bool fits = true;  ///< no cone has more than kMostTouches
  Index* begin;      ///< first touch of each cone                                    (cones + 1)
  Index* row;        ///< first row of each cone                                      (cones + 1)
  Index* block;      ///< of each touch                                               (kMostTouches cones)
  Index* cone;       ///< of each touch                                               (kMostTouches cones)
  Index* of_begin;   ///< first entry of each block in `of_block`                     (blocks + 1)
  Index* of_block;   ///< touches by block                                            (kMostTouches cones)
  Index* entry;      ///< where J of each touch begins: a row of kBodyBlock for each row  (kMostTouches cones)
  Index* parts;      ///< of a scan                                                   (kScanParts)

  static STICTION_HD constexpr Offset integers(Offset cones, Offset dofs) {
    return 2 * (cones + 1) + 4 * kMostTouches * cones + DofBlocks::most(dofs) + 1 + kScanParts;
  }

  STICTION_HD ConeTouches(Index cone_count, Index dofs, Index*& memory) : cones(cone_count) {
    const auto take = [&memory](Offset size) {
      Index* const part = memory;
      memory += size;
      return part;
    };
    const Offset most = Offset{kMostTouches} * cones;
    begin = take(Offset{cones} + 1);
    row = take(Offset{cones} + 1);
    block = take(most);
    cone = take(most);
    of_block = take(most);
    entry = take(most);
    of_begin = take(DofBlocks::most(dofs) + 1);
    parts = take(kScanParts);
  }

  [[nodiscard]] STICTION_HD Index rows(Index c) const { return row[c + 1] - row[c]; }

  /// Lists all touches. Lanes of a team hold equal copies.
  template <Team TeamT, class Real>
  STICTION_HD_OUTLINE void find(TeamT& team, const JacobianBatchView<Real>& batch, const LaneEnv<Real>& env,
                                const DofBlocks& dofs) {
    std::uint32_t too_many = 0;
    for_each(team, cones, [&](Index c) {
      const Offset* const of = batch.cone_row_offsets + env.first_cone + c;
      row[c] = static_cast<Index>(of[0] - env.first_row);
      if (c + 1 == cones) row[cones] = static_cast<Index>(of[1] - env.first_row);
      Index list[kMostTouches];
      begin[c] = list_blocks(batch, of[0], of[1], env.dofs, dofs, list);
      if (begin[c] < 0) too_many = 1;
    });
    fits = team.combine(too_many) == 0;
    if (!fits) return;
    count = exclusive_scan(team, begin, cones, parts);
    single(team, [&] { begin[cones] = count; });
    for_each(team, cones, [&](Index c) {
      const Offset* const of = batch.cone_row_offsets + env.first_cone + c;
      list_blocks(batch, of[0], of[1], env.dofs, dofs, block + begin[c]);
      for (Index t = begin[c]; t < begin[c + 1]; ++t) cone[t] = c;
    });
    single(team, [&] { list_by_block(dofs.count); });
  }

 private:
  /// Lists the blocks that rows touch, in ascending order; returns their number, -1 if there are too many.
  template <class Real>
  static STICTION_HD Index list_blocks(const JacobianBatchView<Real>& batch, Offset first, Offset end, Index columns,
                                       const DofBlocks& dofs, Index* list) {
    Index found = 0;
    for (Offset at = first; at < end; ++at) {
      const Offset from = batch.row_offsets[at];
      const Offset entries = batch.column == nullptr ? Offset{columns} : batch.row_offsets[at + 1] - from;
      for (Offset k = 0; k < entries; ++k) {
        if (batch.J[from + k] == Real(0)) continue;
        const Index block = dofs.of_dof[batch.column == nullptr ? k : Offset{batch.column[from + k]}];
        Index place = found;
        while (place > 0 && list[place - 1] > block) --place;
        if (place > 0 && list[place - 1] == block) continue;
        if (found == kMostTouches) return -1;
        for (Index i = found++; i > place; --i) list[i] = list[i - 1];
        list[place] = block;
      }
    }
    return found;
  }

  STICTION_HD void list_by_block(Index blocks) {
    for (Index b = 0; b <= blocks; ++b) of_begin[b] = 0;
    Index entries = 0;
    for (Index t = 0; t < count; ++t) {
      ++of_begin[block[t] + 1];
      entry[t] = entries;
      entries += rows(cone[t]) * kBodyBlock;
    }
    for (Index b = 0; b < blocks; ++b) of_begin[b + 1] += of_begin[b];
    for (Index t = count - 1; t >= 0; --t) of_block[--of_begin[block[t] + 1]] = t;
    for (Index b = 0; b < blocks; ++b) of_begin[b] = of_begin[b + 1];
    of_begin[blocks] = count;
  }
};

}  // namespace stiction::inline STICTION_ISA
