#pragma once

#include "core/job/articulated_reset_job.hpp"
#include "core/team/phases.hpp"

namespace stiction::inline STICTION_ISA {

/// Resets an environment if it is in the mask.
template <Team TeamT, class Real>
STICTION_HD void reset_masked(TeamT& team, const ArticulatedResetJob<Real>& job, Offset env) {
  if (job.mask[env] == 0) return;
  const auto clear = [&](auto* array, Index width) {
    share(team, width, [&](Index k) { array[env * width + k] = 0; });
  };
  share(team, job.q_count, [&](Index k) { job.to.qpos[env * job.q_count + k] = job.first[k]; });
  clear(job.to.qvel, job.dof_count);
  clear(job.to.qacc, job.dof_count);
  clear(job.to.qfrc_applied, job.dof_count);
  clear(job.to.ctrl, job.actuator_count);
  clear(job.to.time, 1);
}

}  // namespace stiction::inline STICTION_ISA
