#pragma once

#include "core/algorithm/velocity/lane_env.hpp"
#include "core/job/derivative_job.hpp"

namespace stiction::inline STICTION_ISA {

/// Whether an environment may be taken, as far as its numbers do not decide. Its rows, J and M are known to be sound.
template <class Real>
STICTION_HD bool takes_adjoint(const JacobianVjpJob<Real>& job, Offset env) {
  const JacobianBatchView<Real>& batch = job.assembly.batch;
  if ((job.assembly.to.flags[env] & kNotAssembled) != 0) return false;
  const bool is_solved = job.contact.at.status == nullptr || job.contact.at.status[env].code == EnvCode::solved;
  const Index dofs = batch.env_dofs(env);
  return job.contact.law == Law::convex && is_solved && dofs > 0 && dofs <= kMostVelocityDofs &&
         batch.env_rows(env) <= kMostVelocityRows && takes_form(batch, env);
}

}  // namespace stiction::inline STICTION_ISA
