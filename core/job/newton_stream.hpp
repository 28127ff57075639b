#pragma once

#include "core/job/block_pattern.hpp"

namespace stiction {

/// The integers of Newton's method in body space for one environment, as they follow one another in its stream. A row
/// of blocks is a body; bodies that nothing pushes keep a row of their own without couplings. Entries of contacts are
/// positions: p where the row's body is the contact's b, ~p where it is its a.
struct NewtonStream {
  BlockPattern pattern;
  const Index* mirror = nullptr;          ///< of each block, where its transpose is             (blocks)
  const Index* block_offsets = nullptr;   ///< into `block_contacts`                             (blocks + 1)
  const Index* block_contacts = nullptr;  ///< that join the block's two bodies, in order of position; on the diagonal
                                          ///< all of the body's                                 (block_offsets[blocks])
  Index levels = 0;                       ///< of a breadth-first search of the pushed bodies
  const Index* level_offsets = nullptr;   ///< into `level_bodies`                               (levels + 1)
  const Index* level_bodies = nullptr;    ///< bodies by level                                   (rows)
  const Index* level_links = nullptr;     ///< beyond level 0: the contact with the level before (rows)
  const Index* preconditioner = nullptr;  ///< integers of the preconditioner
};

/// Takes an environment's stream apart.
STICTION_HD NewtonStream take_newton_stream(const Index* stream) {
  NewtonStream v;
  v.pattern = take_pattern(stream);
  const Index blocks = v.pattern.blocks();
  v.mirror = take_table(stream, blocks);
  v.block_offsets = take_table(stream, blocks + 1);
  v.block_contacts = take_table(stream, v.block_offsets[blocks]);
  v.levels = *take_table(stream, 1);
  v.level_offsets = take_table(stream, v.levels + 1);
  v.level_bodies = take_table(stream, v.pattern.rows);
  v.level_links = take_table(stream, v.pattern.rows);
  v.preconditioner = stream;
  return v;
}

}  // namespace stiction
