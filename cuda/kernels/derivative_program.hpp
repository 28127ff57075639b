#pragma once

#include "core/algorithm/derivative/jvp.hpp"
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

/// derive(scratch) where the environment is sound and there is room for it, else refuse(flags).
template <Team TeamT, class Job, class Derive, class Refuse>
STICTION_HD void derive_checked(TeamT& team, const cuda::TeamId& id, const cuda::DerivativeArgs<Job>& args, Offset env,
                                const Derive& derive, const Refuse& refuse) {
  const auto& batch = args.job.batch;
  const bool is_sound = structure_is_sound(team, with_totals(batch), env);
  if (!is_sound) {
    single(team, [&] { args.job.status[env] = {0.0, 0.0, kGradientBadStructure, 0, 0, 0}; });
  } else if (batch.env_rows(env) > args.most_rows || batch.env_dofs(env) > args.most_dofs) {
    refuse(kGradientOverCapacity);
  } else {
    derive(args.scratch + id.index * args.slot);
  }
}

template <class Real>
struct PullBack {
  using Args = cuda::DerivativeArgs<VjpJob<Real>>;
  static constexpr bool kSerial = false;

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    for (Offset env = id.index; env < args.job.batch.env_count; env += id.count)
      derive_checked(
          team, id, args, env, [&](double* scratch) { vjp_env(team, args.job, env, scratch); },
          [&](std::uint32_t flags) { refuse_vjp(team, args.job, env, flags); });
  }
};

template <class Real>
struct PushForward {
  using Args = cuda::DerivativeArgs<JvpJob<Real>>;
  static constexpr bool kSerial = false;

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    for (Offset env = id.index; env < args.job.batch.env_count; env += id.count)
      derive_checked(
          team, id, args, env, [&](double* scratch) { jvp_env(team, args.job, env, scratch); },
          [&](std::uint32_t flags) { refuse_jvp(team, args.job, env, flags); });
  }
};

}  // namespace stiction::inline STICTION_ISA
