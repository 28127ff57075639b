#include "core/machine/world_machine.hpp"

#include <string>

#include "stiction/error.hpp"

namespace stiction {

void check_near_pairs(Offset near, Offset env) {
  if (near > kMostNearPairs)
    throw Error(ErrorCode::out_of_memory, "environment " + std::to_string(env) + " has " + std::to_string(near) +
                                              " pairs of shapes that are near each other: at most " +
                                              std::to_string(kMostNearPairs) + "; put its bodies further apart");
}

}  // namespace stiction
