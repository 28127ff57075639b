#pragma once

#include "core/algorithm/driver/solver_selection.hpp"
#include "core/algorithm/problem/slice.hpp"
#include "core/job/fallback_chain.hpp"
#include "cuda/api/kernel.hpp"
#include "cuda/kernels/plan_args.hpp"

namespace stiction::cuda {

/// What choosing solvers takes beside the job.
template <class Real>
struct ChooseArgs {
  SolveJob<Real> job;      ///< with the caller's warm start
  PlanArrays plan;         ///< sound; the keys are written
  std::uint8_t* assigned;  ///< the stage that each environment stands on, kept from stage to stage  (envs)
  int stage;               ///< the one to be solved next
  ClassLimits limits;      ///< of the dense classes under its solver
};

}  // namespace stiction::cuda

namespace stiction::inline STICTION_ISA {

/// Before every stage of the fallback chain: which environments it gets. An environment that this stage does not solve
/// goes to the trivial class, which no stage launches.
template <class Real>
struct ChooseEnvironments {
  using Args = cuda::ChooseArgs<Real>;
  static constexpr bool kSerial = false;

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    for (Offset index = id.index; index < args.job.batch.env_count; index += id.count) {
      const EnvPath path = args.plan.path[index];
      SizeClass own = SizeClass::trivial;
      Index rows = 0;
      if (path != EnvPath::empty && assign(team, args, index) == args.stage) {
        rows = args.job.batch.env_rows(index);
        own = size_class(path, rows, args.limits);
      }
      single(team, [&] { args.plan.key[index] = static_cast<std::uint8_t>(sort_key(own, rows, args.limits)); });
    }
  }

 private:
  /// The stage that an environment stands on now, on every lane.
  template <Team TeamT>
  static STICTION_HD int assign(TeamT& team, const Args& args, Offset index) {
    std::uint8_t& assigned = args.assigned[index];
    const EnvView<Real> env = slice(args.job, index);
    int stage = assigned;
    if (args.stage == 0) {
      begin_fallbacks(team, env);
      stage = first_stage(features(team, env));
    } else if (stage == args.stage - 1 && falls_short(*env.status)) {
      stage = next_stage(stage, features(team, env));
    }
    // Every lane has read the stage that was assigned.
    team.sync();
    single(team, [&] { assigned = static_cast<std::uint8_t>(stage); });
    return stage;
  }
};

}  // namespace stiction::inline STICTION_ISA
