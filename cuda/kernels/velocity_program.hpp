#pragma once

#include "core/algorithm/jacobian/jacobian_batch.hpp"
#include "core/algorithm/velocity/evaluate/velocity_result.hpp"
#include "core/algorithm/velocity/lanes/dof_islands.hpp"
#include "cuda/kernels/lane_memory.hpp"

namespace stiction::cuda {

/// Arguments of Newton's method in velocities beside the job.
template <class Real>
struct VelocityArgs : LaneRoom {
  VelocityJob<Real> job;
  JacobianArrays<Real> arrays;
  Index* islands;  ///< of each lane of each team                    (teams * kWarp * islands_per_lane)
  Offset islands_per_lane;
};

}  // namespace stiction::cuda

namespace stiction::inline STICTION_ISA {

/// One lane per environment that teams have not tried, before anything is assembled. `kInParts`: also environments of
/// more than kMostVelocityDofs, one of their parts after the other. They take code and memory that a batch without them
/// shall not pay for. `Number`: in
/// which steps are taken. With the batch's own, environments that ask for double are taken if a kernel before has left
/// them.
template <class Real, class Number, bool kInParts>
struct SolveVelocities {
  using Args = cuda::VelocityArgs<Real>;
  using Types = LaneTypes<Number, cuda::kWarp, DofSet, Real>;
  using Large = LaneTypes<Number, cuda::kWarp, LargeDofSet, Real>;
  static constexpr bool kSerial = false;
  static constexpr int kThreads = cuda::kTeamThreads;

  using Place = LanePlace<Args>;

  /// Solves an environment, or a part of one.
  static STICTION_HD VelocityResult solve(LaneEnv<Real> part, const Place& place) {
    VelocityResult result;
    part.result = &result;
    if (part.dofs <= kMostVelocityDofs)
      solve_pack<Types>(place.args.job, &part, 1, LaneMemory<Types>{place.args, place.team, place.lane});
    else if constexpr (kInParts)
      solve_pack<Large>(place.args.job, &part, 1, LaneMemory<Large>{place.args, place.team, place.lane});
    return result;
  }

  static STICTION_HD void solve_env(Offset env, const Place& place) {
    const Args& args = place.args;
    const LaneEnv<Real> whole = lane_env(args.job.batch, env);
    if (whole.dofs <= kMostVelocityDofs) {
      if (takes_size(args.job.batch, whole, args.job.law)) finish(args.job, env, solve(whole, place));
    } else if constexpr (kInParts) {
      solve_in_parts(env, place);
    }
  }

  static STICTION_HD void solve_in_parts(Offset env, const Place& place) {
    const Args& args = place.args;
    DofIslands<Real> islands(args.job.batch, env, place.islands());
    islands.find();
    for (Index i = 0; i < islands.count(); ++i)
      if (!takes_size(args.job.batch, islands.part(i), args.job.law)) return;
    VelocityResult result;
    for (Index i = 0; i < islands.count() && result.is_answered; ++i) join(result, solve(islands.part(i), place));
    finish(args.job, env, result);
  }

  static STICTION_HD bool takes(const Args& args, Offset env) {
    const bool in_double = steps_in_double(args.job, env);
    constexpr bool kInDouble = sizeof(Number) > sizeof(Real);
    if ((args.job.answered[env] & (kAnswered | (kInDouble ? kTriedInDouble : kTried))) != 0) return false;
    if constexpr (kInDouble) return in_double;
    return !in_double || is_tried_again(lane_env(args.job.batch, env));
  }

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    const Offset envs = args.job.batch.env_count;
    for (Offset first = id.index * cuda::kWarp; first < envs; first += id.count * cuda::kWarp)
      for_each(team, cuda::kWarp, [&](Index lane) {
        const Offset env = first + lane;
        if (env >= envs || (args.arrays.flags[env] & kNotAssembled) != 0 || !takes_form(args.job.batch, env)) return;
        if (!takes(args, env)) return;
        solve_env(env, Place{args, id.index, lane});
        leave_out_answered(args.arrays, env);
      });
  }
};

}  // namespace stiction::inline STICTION_ISA
