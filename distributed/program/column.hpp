#pragma once

#include <cstdint>

#include "distributed/program/commands.hpp"
#include "stiction/bodies.hpp"

/// Scene granular-column of `stiction-mpi solve`: spheres in a box 15 times as high as wide. It has no matrices.
namespace stiction::distributed {

inline constexpr const char* kColumn = "granular-column";

struct ColumnScene {
  Index side = 0, layers = 0;  ///< in cells of four spheres
  TimeStepping stepping;
  Law law = Law::coulomb;
};

/// \throws Error(invalid_argument) for a law or a size that it does not take.
ColumnScene column_scene(const SolveArguments& arguments);

/// The seed of one environment's numbers.
std::uint64_t column_seed(const SolveArguments& arguments, std::int64_t env);

}  // namespace stiction::distributed
