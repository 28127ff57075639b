#pragma once

#include "core/base/real.hpp"
#include "core/job/velocity_job.hpp"

/// From the results of an environment's parts to its status.
namespace stiction::inline STICTION_ISA {

/// Takes a part in, whose islands are islands of the whole.
STICTION_HD void join(VelocityResult& whole, const VelocityResult& part) {
  whole.relative = max_(part.relative, whole.relative);
  whole.absolute = max_(part.absolute, whole.absolute);
  whole.flags |= part.flags;
  whole.steps = part.steps > whole.steps ? part.steps : whole.steps;
  whole.is_answered = whole.is_answered && part.is_answered;
  whole.is_rounding = whole.is_rounding || part.is_rounding;
}

/// Writes down whether an environment is answered, and its status if it is.
template <class Real>
STICTION_HD void finish(const VelocityJob<Real>& job, Offset env, const VelocityResult& result) {
  job.answered[env] = result.is_answered ? kAnswered : 0;
  if (!result.is_answered) return;
  const std::uint32_t before = job.batch.env_flags == nullptr ? 0U : job.batch.env_flags[env];
  job.to.status[env] = EnvStatus{result.relative,
                                 result.absolute,
                                 before | result.flags,
                                 result.steps,
                                 result.is_rounding ? EnvCode::rounding : EnvCode::solved,
                                 SolverKind::velocity_newton,
                                 {0, 0},
                                 0};
}

}  // namespace stiction::inline STICTION_ISA
