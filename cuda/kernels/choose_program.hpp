#pragma once

#include "core/algorithm/driver/solver_selection.hpp"
#include "core/algorithm/problem/slice.hpp"
#include "cuda/api/kernel.hpp"
#include "cuda/kernels/plan_args.hpp"

namespace stiction::cuda {

/// Arguments of choosing solvers beside the job.
template <class Real>
struct ChooseArgs {
  SolveJob<Real> job;  ///< with the caller's warm start
  PlanArrays plan;     ///< sound; the keys are written
  ChainArrays chain;   ///< written
  ClassLimits limits;  ///< of the dense classes under the first stage's solver
};

}  // namespace stiction::cuda

namespace stiction::inline STICTION_ISA {

/// Before the first stage of the fallback chain: features of every environment, and the turn it begins with. One that
/// the first stage does not solve goes to the trivial class, which no stage launches.
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
      if (path != EnvPath::empty && begin(team, args, index) == 0) {
        rows = args.job.batch.env_rows(index);
        own = size_class(path, rows, args.limits);
      }
      single(team, [&] { args.plan.key[index] = static_cast<std::uint8_t>(sort_key(own, rows, args.limits)); });
    }
  }

 private:
  /// The turn that an environment begins with, on every lane.
  template <Team TeamT>
  static STICTION_HD int begin(TeamT& team, const Args& args, Offset index) {
    const EnvView<Real> env = slice(args.job, index);
    begin_fallbacks(team, env);
    const EnvFeatures seen = features(team, env);
    const int turn = first_turn(seen);
    single(team, [&] {
      args.chain.features[index] = seen;
      args.chain.assigned[index] = static_cast<std::uint8_t>(turn);
    });
    return turn;
  }
};

}  // namespace stiction::inline STICTION_ISA
