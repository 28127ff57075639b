#pragma once

#include "core/base/ladder.hpp"
#include "core/body/choose_body.hpp"
#include "core/body/job_slice.hpp"
#include "cuda/device/kernel.hpp"
#include "cuda/programs/plan_args.hpp"

namespace stiction::cuda {

/// What choosing solvers takes beside the job.
template <class Real>
struct ChooseArgs {
  SolveJob<Real> job;    ///< with the caller's warm start
  PlanArrays plan;       ///< sound; the keys are written
  SolverKind* assigned;  ///< who is to solve each environment, kept from rung to rung         (envs)
  int rung;              ///< the one to be solved next
  SizeClass finest;      ///< class of the smallest dense environments under its solver
};

}  // namespace stiction::cuda

namespace stiction::inline STICTION_ISA {

/// Before every rung of the ladder: whom it gets. An environment that this rung does not solve goes to the settled
/// class, which no rung launches.
template <class Real>
struct ChooseEnvironments {
  using Args = cuda::ChooseArgs<Real>;
  static constexpr bool kSerial = false;

  template <class Team>
  static STICTION_HD void run(Team& team, const cuda::TeamId& id, const Args& args) {
    const SolverKind next = ladder_rung(args.rung);
    for (Offset index = id.index; index < args.job.batch.env_count; index += id.count) {
      const EnvPath path = args.plan.path[index];
      SizeClass own = SizeClass::settled;
      Index rows = 0;
      if (path != EnvPath::empty && assign(team, args, index) == next) {
        rows = args.job.batch.env_rows(index);
        own = size_class(path, rows);
        if (path == EnvPath::dense && own > args.finest) own = args.finest;
      }
      single(team, [&] { args.plan.key[index] = static_cast<std::uint8_t>(sort_key(own, rows)); });
    }
  }

 private:
  /// Who is to solve an environment now, on every lane.
  template <class Team>
  static STICTION_HD SolverKind assign(Team& team, const Args& args, Offset index) {
    SolverKind& assigned = args.assigned[index];
    const EnvView<Real> env = slice(args.job, index);
    SolverKind solver = assigned;
    if (args.rung == 0) {
      begin_climb(team, env);
      solver = first_solver(features(team, env));
    } else if (solver == ladder_rung(args.rung - 1) && falls_short(*env.status)) {
      solver = next_solver(solver, features(team, env));
    }
    // Every lane has read who it was.
    team.sync();
    single(team, [&] { assigned = solver; });
    return solver;
  }
};

}  // namespace stiction::inline STICTION_ISA
