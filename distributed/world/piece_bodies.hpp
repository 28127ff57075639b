#pragma once

#include <vector>

#include "stiction/types.hpp"

namespace stiction::distributed {

/// Bodies of a rank's piece: those it owns, and the ghosts that contacts of its own bodies push.
struct PieceBodies {
  std::vector<Index> body;  ///< the world's number, ascending
  std::vector<int> owner;
  int rank = 0;  ///< that has the piece

  [[nodiscard]] bool owns(Index piece_body) const { return owner[static_cast<std::size_t>(piece_body)] == rank; }
};

}  // namespace stiction::distributed
