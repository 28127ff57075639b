#pragma once

#include "core/algorithm/derivative/jacobian_pack.hpp"
#include "core/algorithm/derivative/jacobian_pack_limits.hpp"
#include "core/algorithm/velocity/lanes/dof_islands.hpp"
#include "cuda/kernels/lane_memory.hpp"

namespace stiction::cuda {

/// Arguments of derivatives in lanes, of one direction.
template <class Real>
struct JacobianLanesArgs : LaneRoom {
  JacobianVjpJob<Real> job;
  JacobianJvpJob<Real> forward;
  bool is_forward;
  std::uint8_t* answered;   ///< out: 1 where a lane has written all but cotangents of J and M  (env_count)
  Index* islands;           ///< of each lane of each team                    (teams * kWarp * islands_per_lane)
  Offset islands_per_lane;  ///< 0: no environment is taken part by part
};

}  // namespace stiction::cuda

namespace stiction::inline STICTION_ISA {

/// One lane per environment, before teams take the rest (derivative_program.hpp). One kernel has both directions.
template <class Real>
struct DerivativeLanesProgram {
  using Args = cuda::JacobianLanesArgs<Real>;
  using Types = LaneTypes<Real, cuda::kWarp>;
  using Large = LaneTypes<Real, cuda::kWarp, LargeDofSet>;
  static constexpr bool kSerial = false;
  static constexpr int kThreads = cuda::kTeamThreads;

  using Place = LanePlace<Args>;

  /// An environment, or a part of one.
  template <class Job>
  static STICTION_HD JacobianPackResult derive(const Job& job, const LaneEnv<Real>& part, double scale,
                                               const Place& place) {
    JacobianPackResult result;
    result.scale = scale;
    if (!takes_derivative_size(part) || part.rows > place.args.largest.rows)
      result.is_answered = false;
    else if (part.dofs <= kMostVelocityDofs)
      jacobian_pack<Types>(job, &part, &result, 1, LaneMemory<Types>{place.args, place.team, place.lane});
    else
      jacobian_pack<Large>(job, &part, &result, 1, LaneMemory<Large>{place.args, place.team, place.lane});
    return result;
  }

  template <class Job>
  static STICTION_HD_OUTLINE JacobianPackResult derive_parts(const Job& job, Offset env, const Place& place) {
    const JacobianBatchView<Real>& batch = job.assembly.batch;
    DofIslands<Real> islands(batch, env, place.islands());
    islands.find();
    JacobianPackResult result;
    for (Index i = 0; i < islands.count(); ++i)
      result.is_answered = result.is_answered && takes_part(job, islands.part(i));
    const double scale = free_motion(batch, env);
    for (Index i = 0; i < islands.count() && result.is_answered; ++i)
      join(result, derive(job, islands.part(i), scale, place));
    return result;
  }

  template <class Job>
  static STICTION_HD void derive_lane(const Job& job, Offset env, const Place& place) {
    const Args& args = place.args;
    args.answered[env] = 0;
    if (!takes_derivative(job, env)) return;
    const LaneEnv<Real> whole = lane_env(job.assembly.batch, env);
    if (whole.dofs <= kMostVelocityDofs && whole.dofs <= args.dofs) {
      finish(job, args.answered, env, derive(job, whole, 0.0, place));
    } else if (args.islands_per_lane >= DofIslands<Real>::integers(whole.dofs, whole.cones)) {
      finish(job, args.answered, env, derive_parts(job, env, place));
    }
  }
  static STICTION_HD void run_lane(Offset env, const Place& place) {
    if (place.args.is_forward)
      derive_lane(place.args.forward, env, place);
    else
      derive_lane(place.args.job, env, place);
  }

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    const Offset envs = (args.is_forward ? args.forward.assembly : args.job.assembly).batch.env_count;
    for (Offset first = id.index * cuda::kWarp; first < envs; first += id.count * cuda::kWarp)
      for_each(team, cuda::kWarp, [&](Index lane) {
        if (first + lane < envs) run_lane(first + lane, Place{args, id.index, lane});
      });
  }
};

}  // namespace stiction::inline STICTION_ISA
