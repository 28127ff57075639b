#pragma once

#include "stiction/types.hpp"

namespace stiction {

/// Features on which the choice of a solver under SolverKind::automatic depends (docs/math/auto.md).
struct EnvFeatures {
  Index rows = 0;
  Offset entries = 0;         ///< multiplications of a product with A: its stored entries, or twice its factor's
  Index friction_cones = 0;   ///< boxed or not
  Index boxed_cones = 0;      ///< those of them whose friction is boxed: for sweeps, and pivots where all are
  Index axes = 0;             ///< rows of cones but the first of each
  bool has_matrices = false;  ///< some cone is semidefinite: for methods that project only
  bool is_compliant = false;  ///< R > 0 on every row that can carry a reaction
  bool is_pivots = false;     ///< some row's diagonal is not positive: for complementary pivoting only
  double spread = 1.0;        ///< largest over smallest normal diagonal of A + R: effect of mass ratios on A
  Law law = Law::convex;
};

}  // namespace stiction
