#pragma once

#include "core/algorithm/derivative/jacobian_jvp.hpp"
#include "core/algorithm/derivative/jacobian_vjp.hpp"
#include "core/algorithm/plan/structure.hpp"
#include "cuda/api/kernel.hpp"
#include "cuda/kernels/batch_totals.hpp"

namespace stiction::cuda {

/// What derivatives on a device take beside the job.
template <class Job>
struct DerivativeArgs {
  Job job;
  double* scratch;  ///< of each team that runs                     (teams * slot)
  Offset slot;      ///< numbers of it for one team
  Index most_rows;  ///< of an environment that the slot is for
  Index most_dofs;
};

}  // namespace stiction::cuda

/// Derivatives on a device: a team takes an environment at a time. Nothing in the batch's arrays is believed.
namespace stiction::inline STICTION_ISA {

/// Whether an environment, and where it is assembled to, are where the batch says; on every lane. Its rows are written
/// then.
template <Team TeamT, class Job>
STICTION_HD bool is_sound(TeamT& team, const Job& job, Offset env) {
  if (job.has_jacobian) {
    if ((job.assembly.to.flags[env] & kFlagBadStructure) != 0) return false;
    write_rows(team, job.assembly, env);
  }
  return structure_is_sound(team, with_totals(job.contact.batch), env);
}

/// derive(env, scratch) for every environment that is sound and that there is room for, refuse(env, scratch) for those
/// that are too large.
template <Team TeamT, class Job, class Derive, class Refuse>
STICTION_HD void derive_checked(TeamT& team, const cuda::TeamId& id, const cuda::DerivativeArgs<Job>& args,
                                const Derive& derive, const Refuse& refuse) {
  const Job& job = args.job;
  double* const scratch = args.scratch + id.index * args.slot;
  for (Offset env = id.index; env < job.contact.batch.env_count; env += id.count) {
    if (!is_sound(team, job, env)) {
      single(team, [&] { job.contact.status[env] = {0.0, 0.0, kGradientBadStructure, 0, 0, 0}; });
      continue;
    }
    const Index dofs = job.has_jacobian ? job.assembly.batch.env_dofs(env) : job.contact.batch.env_dofs(env);
    if (job.contact.batch.env_rows(env) > args.most_rows || dofs > args.most_dofs)
      refuse(env, scratch);
    else
      derive(env, scratch);
  }
}

template <class Real>
struct PullBack {
  using Args = cuda::DerivativeArgs<JacobianVjpJob<Real>>;
  static constexpr bool kSerial = false;

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    const JacobianVjpJob<Real>& job = args.job;
    derive_checked(
        team, id, args, [&](Offset env, double* scratch) { jacobian_vjp_env<RowTile<Real>>(team, job, env, scratch); },
        [&](Offset env, double* scratch) {
          refuse_jacobian_vjp<RowTile<Real>>(team, job, env, kGradientOverCapacity, scratch);
        });
  }
};

template <class Real>
struct PushForward {
  using Args = cuda::DerivativeArgs<JacobianJvpJob<Real>>;
  static constexpr bool kSerial = false;

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    const JacobianJvpJob<Real>& job = args.job;
    derive_checked(
        team, id, args, [&](Offset env, double* scratch) { jacobian_jvp_env<RowTile<Real>>(team, job, env, scratch); },
        [&](Offset env, double* scratch) {
          refuse_jacobian_jvp<RowTile<Real>>(team, job, env, kGradientOverCapacity, scratch);
        });
  }
};

}  // namespace stiction::inline STICTION_ISA
