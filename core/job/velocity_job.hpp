#pragma once

#include "core/job/jacobian_job.hpp"
#include "stiction/jacobian_solver.hpp"

namespace stiction {

/// Result of Newton's method in velocities for an environment, or for a part of one.
struct VelocityResult {
  double relative = 0.0;    ///< largest error of a contact over its island's scale    [-]
  double absolute = 0.0;    ///< largest error of a contact                            [w]
  std::uint32_t flags = 0;  ///< EnvFlag bits
  Index steps = 0;
  bool is_answered = true;
  bool is_rounding = false;  ///< of an answered one: it is not solved, and roundings are all that is left
};

/// Pointers into the batch. For a sub-problem (dof_islands.hpp), `dof` and `cone` list its members; for a whole
/// environment both are null.
template <class Real>
struct LaneEnv {
  Offset env = -1;  ///< -1: the lane has none
  Index rows = 0;
  Index dofs = 0;
  Index cones = 0;
  Index block = 1;  ///< rows of M's blocks
  Offset first_row = 0;
  Offset first_cone = 0;
  const Real* M = nullptr;
  const Real* v_free = nullptr;
  const Index* dof = nullptr;    ///< of the environment, in the order of numbers  (dofs)
  const Index* local = nullptr;  ///< of each of the environment's, its number in its part
  const Index* cone = nullptr;   ///< of the environment, in ascending order       (cones)
  bool is_consecutive = true;    ///< its degrees of freedom follow one another
  bool is_one_block = true;      ///< and are in one block of M
  bool is_reversed = false;      ///< they are numbered from the last to the first: M is given as a factor
  VelocityResult* result = nullptr;
};

/// Newton's method in velocities on a Jacobian batch, as plain data: input, limits, and where results go.
template <class Real>
struct VelocityJob {
  JacobianBatchView<Real> batch;
  Law law = Law::convex;
  double tolerance = 0.0;           ///< on the relative residual, where the batch has none of the environment's own [-]
  Index max_iterations = 0;         ///< the same
  double absolute_tolerance = 0.0;  ///< on the absolute residual; solved is where either holds [w]
  const Real* warm_start = nullptr;     ///< reactions to start from, or null          (row_count)
  const Real* warm_velocity = nullptr;  ///< velocities to start from, or null; with neither, from v_free (dof_count)
  JacobianSolutionView<Real> to;
  std::uint8_t* answered = nullptr;  ///< out: without kAnswered the environment's output is of no use  (env_count)
};

}  // namespace stiction
