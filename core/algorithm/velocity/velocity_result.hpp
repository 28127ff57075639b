#pragma once

#include "core/base/real.hpp"
#include "core/job/velocity_job.hpp"

/// From what is known of an environment's parts to its status.
namespace stiction::inline STICTION_ISA {

/// Takes a part in. Residuals are relative to the largest |b| of the whole environment, of which no part's is larger.
/// So parts that are solved make a whole that is solved.
STICTION_HD void join(VelocityResult& whole, const VelocityResult& part) {
  whole.absolute = max_(part.absolute, whole.absolute);
  whole.scale = max_(part.scale, whole.scale);
  whole.flags |= part.flags;
  whole.steps = part.steps > whole.steps ? part.steps : whole.steps;
  whole.is_solved = whole.is_solved && part.is_solved;
}

/// Writes down whether an environment is answered, and its status if it is.
template <class Real>
STICTION_HD void finish(const VelocityJob<Real>& job, Offset env, const VelocityResult& result) {
  job.answered[env] = result.is_solved ? 1 : 0;
  if (!result.is_solved) return;
  const std::uint32_t before = job.batch.env_flags == nullptr ? 0U : job.batch.env_flags[env];
  job.to.status[env] = EnvStatus{
      div_(result.absolute, result.scale), result.absolute,   before | result.flags, result.steps, EnvCode::solved,
      SolverKind::velocity_newton,         {0, 0, 0, 0, 0, 0}};
}

}  // namespace stiction::inline STICTION_ISA
