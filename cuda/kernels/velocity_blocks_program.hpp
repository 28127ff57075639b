#pragma once

#include "core/algorithm/jacobian/jacobian_batch.hpp"
#include "core/algorithm/velocity/blocks/block_newton.hpp"
#include "core/algorithm/velocity/evaluate/velocity_result.hpp"
#include "cuda/api/kernel.hpp"

namespace stiction::cuda {

/// Arguments of Newton's method in velocities in blocks beside the job: memory of each team, laid out for the largest
/// environment.
template <class Real>
struct VelocityBlocksArgs {
  VelocityJob<Real> job;
  JacobianArrays<Real> arrays;
  Index* lists;     ///< of each team                          (teams * lists_per_team)
  double* numbers;  ///< of each team                          (teams * numbers_per_team)
  Offset lists_per_team;
  Offset numbers_per_team;
};

}  // namespace stiction::cuda

namespace stiction::inline STICTION_ISA {

/// Environments that lanes have left, one after the other, after SolveVelocities and before anything is assembled.
template <class Real>
struct SolveVelocityBlocks {
  using Args = cuda::VelocityBlocksArgs<Real>;
  static constexpr bool kSerial = false;
  static constexpr int kLanes = cuda::kWarp;

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    const VelocityJob<Real>& job = args.job;
    for (Offset env = id.index; env < job.batch.env_count; env += id.count) {
      const bool is_left = (job.answered[env] & kAnswered) == 0 && (args.arrays.flags[env] & kNotAssembled) == 0;
      if (!is_left || !takes_form(job.batch, env)) continue;
      const LaneEnv<Real> whole = lane_env(job.batch, env);
      if (!takes_blocks(whole)) continue;
      const VelocityResult result = solve_in_blocks(team, job, whole, args.lists + id.index * args.lists_per_team,
                                                    args.numbers + id.index * args.numbers_per_team);
      single(team, [&] {
        finish(job, env, result);
        leave_out_answered(args.arrays, env);
      });
    }
  }
};

}  // namespace stiction::inline STICTION_ISA
