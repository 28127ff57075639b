#pragma once

#include "core/algorithm/derivative/relaxed_derivative.hpp"
#include "core/algorithm/plan/structure.hpp"
#include "cuda/api/kernel.hpp"
#include "cuda/kernels/batch_totals.hpp"
#include "cuda/kernels/unrolled_program.hpp"

namespace stiction::cuda {

/// Arguments of derivatives on a device beside the job, whose kappa is 0 where they are those of the exact problem.
template <class Job, class Real>
struct DerivativeArgs {
  RelaxedJob<Job, Real> job;
  double* scratch;  ///< of each team that runs                     (teams * slot)
  Offset slot;      ///< numbers of it for one team
  Index most_rows;  ///< of an environment that the slot is for
  Index most_dofs;
  const std::uint8_t* written;  ///< 1 where lanes have written all; null: nowhere  (env_count)
};

/// Arguments of pulling back through sweeps: the job is that of a contact batch.
template <class Real>
struct UnrolledArgs : DerivativeArgs<JacobianVjpJob<Real>, Real> {
  SweepsView<Real> sweeps;
};

}  // namespace stiction::cuda

/// Derivatives on a device: a team takes an environment at a time. Nothing in the batch's arrays is believed.
namespace stiction::inline STICTION_ISA {

/// Returns true if an environment, and the place it is assembled to, lie within the batch; on every lane. Its rows are
/// written then.
template <Team TeamT, class Job>
STICTION_HD bool is_sound(TeamT& team, const Job& job, Offset env) {
  if (job.has_jacobian) {
    if ((job.assembly.to.flags[env] & kFlagBadStructure) != 0) return false;
    write_rows(team, job.assembly, env);
  }
  return structure_is_sound(team, with_totals(job.contact.batch), env);
}

/// derive(env, scratch) for every environment that is sound, fits and is not written, refuse(env, scratch) for those
/// that are too large.
template <Team TeamT, class Job, class Real, class Derive, class Refuse>
STICTION_HD void derive_checked(TeamT& team, const cuda::TeamId& id, const cuda::DerivativeArgs<Job, Real>& args,
                                const Derive& derive, const Refuse& refuse) {
  const Job& job = args.job.job;
  double* const scratch = args.scratch + id.index * args.slot;
  for (Offset env = id.index; env < job.contact.batch.env_count; env += id.count) {
    if (args.written != nullptr && args.written[env] != 0) continue;
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

/// Derivatives of the exact problem, or of the relaxed one. Each is a kernel of its own: in one, the exact problem's
/// would have the other's stack.
template <class Real, bool kIsRelaxed>
struct VjpProgram {
  using Args = cuda::DerivativeArgs<JacobianVjpJob<Real>, Real>;
  static constexpr bool kSerial = false;

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    const JacobianVjpJob<Real>& job = args.job.job;
    derive_checked(
        team, id, args,
        [&](Offset env, double* scratch) {
          if constexpr (kIsRelaxed)
            relaxed_jacobian_vjp_env<RowTile<Real>>(team, args.job, env, scratch);
          else
            jacobian_vjp_env<RowTile<Real>>(team, job, env, scratch);
        },
        [&](Offset env, double* scratch) {
          refuse_jacobian_vjp<RowTile<Real>>(team, job, env, kGradientOverCapacity, scratch);
        });
  }
};

template <class Real, bool kIsRelaxed>
struct JvpProgram {
  using Args = cuda::DerivativeArgs<JacobianJvpJob<Real>, Real>;
  static constexpr bool kSerial = false;

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    const JacobianJvpJob<Real>& job = args.job.job;
    derive_checked(
        team, id, args,
        [&](Offset env, double* scratch) {
          if constexpr (kIsRelaxed)
            relaxed_jacobian_jvp_env<RowTile<Real>>(team, args.job, env, scratch);
          else
            jacobian_jvp_env<RowTile<Real>>(team, job, env, scratch);
        },
        [&](Offset env, double* scratch) {
          refuse_jacobian_jvp<RowTile<Real>>(team, job, env, kGradientOverCapacity, scratch);
        });
  }
};

/// Sweeps in reverse, of a contact batch.
template <class Real>
struct UnrolledVjpProgram {
  using Args = cuda::UnrolledArgs<Real>;
  static constexpr bool kSerial = false;

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    UnrolledJob<Real> job;
    static_cast<VjpJob<Real>&>(job) = args.job.job.contact;
    job.sweeps = args.sweeps;
    job.cone_order = nullptr;
    derive_checked(
        team, id, args, [&](Offset env, double* scratch) { plan_and_unroll(team, job, env, scratch, args.slot); },
        [&](Offset env, double*) { refuse_unrolled(team, job, env, kGradientOverCapacity); });
  }
};

}  // namespace stiction::inline STICTION_ISA
