#pragma once

#include "core/job/block_pattern.hpp"
#include "stiction/body_space.hpp"

namespace stiction {

/// One level of a hierarchy, and how it reaches the next. A body is coupled if its row has more than the diagonal;
/// one that is not needs no coarse representation.
struct MultigridLevel {
  Index rows = 0;          ///< bodies
  Index first_row = 0;     ///< rows of the levels before
  Index first_block = 0;   ///< blocks of the matrices before, the finest left out
  Index first_weight = 0;  ///< blocks of the prolongations before
  BlockPattern matrix;     ///< of a level that is not the finest, whose pattern is the caller's

  BlockPattern prolongation;  ///< rows x coarse rows
  const Index* aggregate;     ///< of each body: its coarse body, -1 if it is not coupled          (rows)
  const Index* root;          ///< of each coarse body: the body where its position is             (coarse rows)
  BlockPattern restriction;   ///< the prolongation's transpose
  const Index* transposed;    ///< of each of its blocks: the prolongation's                (restriction.blocks())
  BlockPattern product;       ///< matrix times prolongation

  const Index* place;  ///< of the coarsest level alone: a body's place among the coupled, -1 if it is not  (rows)
};

/// Reads a hierarchy that append_multigrid (core/plan/multigrid_plan.hpp) wrote.
struct MultigridView {
  const Index* stream = nullptr;

  /// Integers before the levels' places: length, levels, smoothed, and the sums below.
  static constexpr Index kHeader = 9;

  [[nodiscard]] STICTION_HD Index levels() const { return stream[1]; }
  [[nodiscard]] STICTION_HD bool is_smoothed() const { return stream[2] != 0; }
  [[nodiscard]] STICTION_HD Index finest_rows() const { return stream[3]; }
  [[nodiscard]] STICTION_HD Index all_rows() const { return stream[4]; }       ///< of all levels
  [[nodiscard]] STICTION_HD Index coarse_blocks() const { return stream[5]; }  ///< of all matrices but the finest
  [[nodiscard]] STICTION_HD Index weights() const { return stream[6]; }        ///< blocks of all prolongations
  [[nodiscard]] STICTION_HD Index largest_product() const { return stream[7]; }
  [[nodiscard]] STICTION_HD Index dense_bodies() const { return stream[8]; }  ///< coupled ones of the coarsest level

  [[nodiscard]] STICTION_HD MultigridLevel level(Index l) const {
    MultigridLevel level{};
    const Index* next = stream + stream[kHeader + l];
    level.rows = next[0];
    level.first_row = next[1];
    level.first_block = next[2];
    level.first_weight = next[3];
    next += 4;
    if (l > 0) level.matrix = take_pattern(next);
    if (l + 1 == levels()) {
      level.place = take_table(next, level.rows);
      return level;
    }
    level.prolongation = take_pattern(next);
    level.aggregate = take_table(next, level.rows);
    level.root = take_table(next, level.prolongation.columns_total);
    level.restriction = take_pattern(next);
    level.transposed = take_table(next, level.restriction.blocks());
    level.product = take_pattern(next);
    return level;
  }
};

/// Takes a hierarchy from the stream, which then begins behind it.
STICTION_HD MultigridView take_multigrid(const Index*& stream) {
  const MultigridView view{stream};
  stream += stream[0];
  return view;
}

}  // namespace stiction
