#pragma once

#include "core/algorithm/jacobian/jacobian_batch.hpp"
#include "core/algorithm/velocity/dof_islands.hpp"
#include "core/algorithm/velocity/solve_pack.hpp"
#include "core/algorithm/velocity/velocity_result.hpp"
#include "cuda/api/kernel.hpp"

namespace stiction::cuda {

/// What Newton's method in velocities takes beside the job. It is memory of each team, in which its lanes' numbers lie
/// side by side, laid out for the largest environment.
template <class Real>
struct VelocityArgs {
  VelocityJob<Real> job;
  JacobianArrays<Real> arrays;
  double* numbers;  ///< of each team                                 (teams * numbers_per_team)
  Offset* lists;    ///< of each lane of each team                    (teams * kWarp * lists_per_lane)
  Index* islands;   ///< of each lane of each team                    (teams * kWarp * islands_per_lane)
  Offset numbers_per_team;
  Offset lists_per_lane;
  Offset islands_per_lane;
  SlotCounts largest;
  Index dofs;
  Index tree_entries;
  bool in_blocks;         ///< by teams, what is left; else by lanes
  Index* block_lists;     ///< of each team                          (block_teams * block_lists_per_team)
  double* block_numbers;  ///< of each team                          (block_teams * block_numbers_per_team)
  Offset block_lists_per_team;
  Offset block_numbers_per_team;
};

}  // namespace stiction::cuda

namespace stiction::inline STICTION_ISA {

/// One lane per environment, before anything is assembled. What is solved has no part in that. `kInParts`: also
/// environments of more than kMostVelocityDofs, one of their parts after the other. They take code and memory that a
/// batch without them shall not pay for.
template <class Real, bool kInParts>
struct SolveVelocities {
  using Args = cuda::VelocityArgs<Real>;
  using Types = LaneTypes<Real, cuda::kWarp>;
  using Large = LaneTypes<Real, cuda::kWarp, LargeDofSet>;
  static constexpr bool kSerial = false;
  static constexpr int kThreads = cuda::kTeamThreads;

  template <class Lane>
  struct LaneMemory {
    const Args& args;
    Offset team;
    Index lane;
    STICTION_HD void* lists(Offset) const { return args.lists + (team * cuda::kWarp + lane) * args.lists_per_lane; }
    STICTION_HD Index* islands() const { return args.islands + (team * cuda::kWarp + lane) * args.islands_per_lane; }
    STICTION_HD VelocityWorkspace<Lane> numbers(const SlotCounts&, Index, Index) const {
      return VelocityWorkspace<Lane>(args.numbers + team * args.numbers_per_team, args.largest, args.dofs,
                                     args.tree_entries, lane);
    }
  };
  using Memory = LaneMemory<Types>;

  /// Solves an environment, or a part of one.
  static STICTION_HD VelocityResult solve(LaneEnv<Real> part, const Memory& memory) {
    VelocityResult result;
    part.result = &result;
    if (part.dofs <= kMostVelocityDofs)
      solve_pack<Types>(memory.args.job, &part, 1, memory);
    else if constexpr (kInParts)
      solve_pack<Large>(memory.args.job, &part, 1, LaneMemory<Large>{memory.args, memory.team, memory.lane});
    return result;
  }

  static STICTION_HD void solve_env(Offset env, const Memory& memory) {
    const Args& args = memory.args;
    const LaneEnv<Real> whole = lane_env(args.job.batch, env);
    if (whole.dofs <= kMostVelocityDofs) {
      if (takes_size(args.job.batch, whole, args.job.law)) finish(args.job, env, solve(whole, memory));
    } else if constexpr (kInParts) {
      solve_in_parts(env, memory);
    }
  }

  static STICTION_HD void solve_in_parts(Offset env, const Memory& memory) {
    const Args& args = memory.args;
    DofIslands<Real> islands(args.job.batch, env, memory.islands());
    islands.find();
    for (Index i = 0; i < islands.count(); ++i)
      if (!takes_size(args.job.batch, islands.part(i), args.job.law)) return;
    VelocityResult result;
    for (Index i = 0; i < islands.count() && result.is_solved; ++i) join(result, solve(islands.part(i), memory));
    finish(args.job, env, result);
  }

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    const Offset envs = args.job.batch.env_count;
    for (Offset first = id.index * cuda::kWarp; first < envs; first += id.count * cuda::kWarp)
      for_each(team, cuda::kWarp, [&](Index lane) {
        const Offset env = first + lane;
        if (env >= envs || (args.arrays.flags[env] & kNotAssembled) != 0 || !takes_form(args.job.batch, env)) return;
        solve_env(env, Memory{args, id.index, lane});
        leave_out_answered(args.arrays, env);
      });
  }
};

}  // namespace stiction::inline STICTION_ISA
