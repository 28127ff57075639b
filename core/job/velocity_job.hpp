#pragma once

#include "stiction/jacobian_solver.hpp"

namespace stiction {

/// Newton's method in velocities on a Jacobian batch, as plain data: what is read, when to stop, where results go.
template <class Real>
struct VelocityJob {
  JacobianBatchView<Real> batch;
  Law law = Law::convex;
  double tolerance = 0.0;    ///< on the relative residual, where the batch has none of the environment's own [-]
  Index max_iterations = 0;  ///< the same
  const Real* warm_start = nullptr;  ///< reactions, or null: start from v_free        (row_count)
  JacobianSolutionView<Real> to;
  std::uint8_t* answered =
      nullptr;  ///< out: 1: the environment has its answer; 0: nothing of it was written (env_count)
};

}  // namespace stiction
