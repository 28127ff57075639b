#pragma once

#include "core/algorithm/jacobian/jacobian_batch.hpp"
#include "core/algorithm/velocity/solve_pack.hpp"
#include "cuda/device/kernel.hpp"

namespace stiction::cuda {

/// What Newton's method in velocities takes beside the job: memory of each team, in which its lanes' numbers lie
/// side by side, laid out for the largest environment.
template <class Real>
struct VelocityArgs {
  VelocityJob<Real> job;
  JacobianArrays<Real> arrays;
  double* numbers;  ///< of each team                                 (teams * numbers_per_team)
  Offset* lists;    ///< of each lane of each team                    (teams * kWarp * lists_per_lane)
  Offset numbers_per_team;
  Offset lists_per_lane;
  SlotCounts largest;
  Index dofs;
  Index tree_entries;
};

}  // namespace stiction::cuda

namespace stiction::inline STICTION_ISA {

/// One lane per environment, before anything is assembled. What is solved has no part in that.
template <class Real>
struct SolveVelocities {
  using Args = cuda::VelocityArgs<Real>;
  using Types = LaneTypes<Real, cuda::kWarp>;
  static constexpr bool kSerial = false;
  static constexpr int kLanes = cuda::kWarp;

  struct Memory {
    const Args& args;
    Offset team;
    Index lane;
    STICTION_HD void* lists(Offset) const { return args.lists + (team * cuda::kWarp + lane) * args.lists_per_lane; }
    STICTION_HD VelocityWorkspace<Types> numbers(const SlotCounts&, Index, Index) const {
      return VelocityWorkspace<Types>(args.numbers + team * args.numbers_per_team, args.largest, args.dofs,
                                      args.tree_entries, lane);
    }
  };

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    const Offset envs = args.job.batch.env_count;
    for (Offset first = id.index * cuda::kWarp; first < envs; first += id.count * cuda::kWarp)
      for_each(team, cuda::kWarp, [&](Index lane) {
        const Offset env = first + lane;
        if (env >= envs || (args.arrays.flags[env] & kNotAssembled) != 0 ||
            !takes_shape(args.job.batch, args.job.law, env))
          return;
        solve_pack<Types>(args.job, &env, 1, Memory{args, id.index, lane});
        leave_out_answered(args.arrays, env);
      });
  }
};

}  // namespace stiction::inline STICTION_ISA
