#pragma once

#include "core/algorithm/derivative/adjoint_limits.hpp"
#include "core/algorithm/derivative/adjoint_pack.hpp"
#include "cuda/kernels/lane_memory.hpp"

namespace stiction::cuda {

/// What pulling back in lanes takes beside the job.
template <class Real>
struct AdjointArgs : LaneRoom {
  JacobianVjpJob<Real> job;
};

}  // namespace stiction::cuda

namespace stiction::inline STICTION_ISA {

/// One lane per environment, before teams take what is left (derivative_program.hpp).
template <class Real>
struct PullLanes {
  using Args = cuda::AdjointArgs<Real>;
  using Types = LaneTypes<Real, cuda::kWarp>;
  static constexpr bool kSerial = false;
  static constexpr int kThreads = cuda::kTeamThreads;

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    const Offset envs = args.job.assembly.batch.env_count;
    for (Offset first = id.index * cuda::kWarp; first < envs; first += id.count * cuda::kWarp)
      for_each(team, cuda::kWarp, [&](Index lane) {
        const Offset env = first + lane;
        if (env >= envs) return;
        args.job.lanes.answered[env] = 0;
        if (!takes_adjoint(args.job, env)) return;
        const LaneEnv<Real> own = lane_env(args.job.assembly.batch, env);
        if (own.rows > args.largest.rows || own.dofs > args.dofs) return;
        pull_pack<Types>(args.job, &own, 1, LaneMemory<Types>{args, id.index, lane});
      });
  }
};

}  // namespace stiction::inline STICTION_ISA
