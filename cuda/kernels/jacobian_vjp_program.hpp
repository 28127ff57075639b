#pragma once

#include "core/algorithm/derivative/jacobian_vjp_limits.hpp"
#include "core/algorithm/derivative/jacobian_vjp_pack.hpp"
#include "core/algorithm/velocity/lanes/dof_islands.hpp"
#include "cuda/kernels/lane_memory.hpp"

namespace stiction::cuda {

/// Arguments of pulling back in lanes beside the job.
template <class Real>
struct JacobianVjpArgs : LaneRoom {
  JacobianVjpJob<Real> job;
  Index* islands;           ///< of each lane of each team                    (teams * kWarp * islands_per_lane)
  Offset islands_per_lane;  ///< 0: no environment is taken part by part
};

}  // namespace stiction::cuda

namespace stiction::inline STICTION_ISA {

/// One lane per environment, before teams take the rest (derivative_program.hpp).
template <class Real>
struct VjpLanesProgram {
  using Args = cuda::JacobianVjpArgs<Real>;
  using Types = LaneTypes<Real, cuda::kWarp>;
  using Large = LaneTypes<Real, cuda::kWarp, LargeDofSet>;
  static constexpr bool kSerial = false;
  static constexpr int kThreads = cuda::kTeamThreads;

  using Place = LanePlace<Args>;

  /// An environment, or a part of one.
  static STICTION_HD JacobianVjpResult vjp(const LaneEnv<Real>& part, double scale, const Place& place) {
    JacobianVjpResult result;
    result.scale = scale;
    if (!takes_vjp_size(part) || part.rows > place.args.largest.rows)
      result.is_answered = false;
    else if (part.dofs <= kMostVelocityDofs)
      jacobian_vjp_pack<Types>(place.args.job, &part, &result, 1,
                               LaneMemory<Types>{place.args, place.team, place.lane});
    else
      jacobian_vjp_pack<Large>(place.args.job, &part, &result, 1,
                               LaneMemory<Large>{place.args, place.team, place.lane});
    return result;
  }

  static STICTION_HD_OUTLINE JacobianVjpResult vjp_of_parts(Offset env, const Place& place) {
    const JacobianBatchView<Real>& batch = place.args.job.assembly.batch;
    DofIslands<Real> islands(batch, env, place.islands());
    islands.find();
    JacobianVjpResult result;
    for (Index i = 0; i < islands.count(); ++i)
      result.is_answered = result.is_answered && takes_vjp_size(islands.part(i));
    const double scale = free_motion(batch, env);
    for (Index i = 0; i < islands.count() && result.is_answered; ++i) join(result, vjp(islands.part(i), scale, place));
    return result;
  }

  static STICTION_HD void vjp_lane(Offset env, const Place& place) {
    const Args& args = place.args;
    args.job.lanes.answered[env] = 0;
    if (!takes_vjp(args.job, env)) return;
    const LaneEnv<Real> whole = lane_env(args.job.assembly.batch, env);
    if (whole.dofs <= kMostVelocityDofs && whole.dofs <= args.dofs)
      finish(args.job, env, vjp(whole, 0.0, place));
    else if (args.islands_per_lane >= DofIslands<Real>::integers(whole.dofs, whole.cones))
      finish(args.job, env, vjp_of_parts(env, place));
  }

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    const Offset envs = args.job.assembly.batch.env_count;
    for (Offset first = id.index * cuda::kWarp; first < envs; first += id.count * cuda::kWarp)
      for_each(team, cuda::kWarp, [&](Index lane) {
        if (first + lane < envs) vjp_lane(first + lane, Place{args, id.index, lane});
      });
  }
};

}  // namespace stiction::inline STICTION_ISA
