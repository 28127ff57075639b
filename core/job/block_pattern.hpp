#pragma once

#include "stiction/types.hpp"

namespace stiction {

/// Rows and columns of a block of a body-space matrix: three of velocity, three of spin.
inline constexpr Index kBodyBlock = 6;

/// Pattern of a matrix of blocks. The host decides it in integers; it travels as a stream of integers, in which
/// several patterns and tables may follow one another.
struct BlockPattern {
  Index rows = 0;                  ///< of blocks
  Index columns_total = 0;         ///< of blocks: the matrix need not be square
  const Index* offsets = nullptr;  ///< into `columns`, by row           (rows + 1)
  const Index* columns = nullptr;  ///< of a row's blocks, ascending     (offsets[rows])

  [[nodiscard]] STICTION_HD Index blocks() const { return offsets[rows]; }
};

/// Takes a pattern from the stream, which then begins behind it: rows, columns_total, offsets, columns.
STICTION_HD BlockPattern take_pattern(const Index*& stream) {
  BlockPattern pattern;
  pattern.rows = stream[0];
  pattern.columns_total = stream[1];
  pattern.offsets = stream + 2;
  pattern.columns = pattern.offsets + pattern.rows + 1;
  stream = pattern.columns + pattern.blocks();
  return pattern;
}

/// Takes a table of `count` integers from the stream.
STICTION_HD const Index* take_table(const Index*& stream, Index count) {
  const Index* const table = stream;
  stream += count;
  return table;
}

}  // namespace stiction
