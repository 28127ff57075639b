#pragma once

#include "core/algorithm/jacobian/jacobian_batch.hpp"
#include "cuda/api/kernel.hpp"

namespace stiction::cuda {

/// What making a contact batch, or velocities, takes beside the job.
template <class Real>
struct JacobianArgs {
  JacobianBatchJob<Real> job;
  Real* scratch;  ///< of each team that runs, or null: it is in fast memory            (teams * slot)
  Offset slot;    ///< numbers of it for one team
};

}  // namespace stiction::cuda

/// The Jacobian form on a device: three programs make the contact batch, one moves the velocities.
namespace stiction::inline STICTION_ISA {

template <class Real>
STICTION_HD Real* scratch_of(const cuda::JacobianArgs<Real>& args, const cuda::TeamId& id) {
  return args.scratch != nullptr ? args.scratch + id.index * args.slot : static_cast<Real*>(id.shared);
}

/// What each environment takes; a team takes one at a time.
template <class Real>
struct CountJacobians {
  using Args = cuda::JacobianArgs<Real>;
  static constexpr bool kSerial = false;

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    for (Offset env = id.index; env < args.job.batch.env_count; env += id.count) count_env(team, args.job, env);
  }
};

/// Where each begins. One team's work.
template <class Real>
struct PlaceJacobians {
  using Args = cuda::JacobianArgs<Real>;
  static constexpr bool kSerial = false;

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    if (id.index == 0) scan_envs(team, args.job);
  }
};

/// Rows, A or Y, and b.
template <class Real>
struct WriteJacobians {
  using Args = cuda::JacobianArgs<Real>;
  static constexpr bool kSerial = false;

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    for (Offset env = id.index; env < args.job.batch.env_count; env += id.count)
      write_env(team, args.job, env, scratch_of(args, id));
  }
};

template <class Real>
struct MoveJacobians {
  using Args = cuda::JacobianArgs<Real>;
  static constexpr bool kSerial = false;

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    for (Offset env = id.index; env < args.job.batch.env_count; env += id.count)
      move_env(team, args.job, env, scratch_of(args, id));
  }
};

}  // namespace stiction::inline STICTION_ISA
