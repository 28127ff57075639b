#pragma once

#include "core/job/velocity_job.hpp"

namespace stiction {

/// Makes the part of a solve that Newton's method in velocities is to do.
template <class Real>
VelocityJob<Real> newton_job(const JacobianBatchView<Real>& batch, const SolverOptions& options,
                             const JacobianSolutionView<Real>& solution, const JacobianStart<Real>& start) {
  VelocityJob<Real> job;
  job.batch = batch;
  job.law = options.law.value_or(batch.law);
  job.tolerance = options.tolerance;
  job.absolute_tolerance = options.absolute_tolerance;
  job.max_iterations = options.max_iterations;
  job.warm_start = start.reactions;
  job.warm_velocity = start.velocities;
  job.to = solution;
  return job;
}

}  // namespace stiction
