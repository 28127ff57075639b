#pragma once

#include "core/algorithm/driver/solve_environment.hpp"
#include "core/algorithm/problem/slice.hpp"
#include "core/algorithm/system/dense_system.hpp"
#include "core/algorithm/system/factor_system.hpp"
#include "core/algorithm/system/sparse_system.hpp"
#include "cuda/api/kernel.hpp"
#include "cuda/kernels/work_queue.hpp"

namespace stiction::inline STICTION_ISA {

/// One team per environment at a time, from its numbers to its status. Teams stay and take the next environment of
/// their class until there is none.
template <class Method, Law kLaw, EnvPath kPath, class Real>
struct SolveTeams {
  using Args = cuda::QueuedJob<Real>;
  static constexpr bool kSerial = false;
  static constexpr bool kTakesDevice = kPath == EnvPath::sparse;  ///< where an environment is large

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    const int size_class = static_cast<int>(args.queue.size_class);
    const Offset begin = args.queue.class_begin[size_class];
    const Offset end = args.queue.class_begin[size_class + 1];
    Real* const memory = args.queue.workspace == nullptr ? static_cast<Real*>(id.shared)
                                                         : args.queue.workspace + id.index * args.queue.slot_elements;
    const SolveJob<Real>& job = args.job;
    for (;;) {
      const Offset position = begin + team.fetch(args.queue.work_counter + size_class);
      if (position >= end) return;
      const Offset index = args.queue.order[position];
      const EnvView<Real> env = slice(job, index);
      const MethodParams<Real> params{job.omega, job.is_fallback_stage()};
      const StopRule rule = stop_rule(job, index);
      if constexpr (kPath == EnvPath::dense) {
        DenseSystem<Real> system(env.counts, Method::workspace(), memory);
        solve_environment<Method, kLaw>(team, env, system, params, rule);
      } else if constexpr (kPath == EnvPath::factor) {
        FactorSystem<Real> system(env, Method::workspace(), memory);
        solve_environment<Method, kLaw>(team, env, system, params, rule);
      } else {
        SparseSystem<Real> system(env, Method::workspace(), memory);
        solve_environment<Method, kLaw>(team, env, system, params, rule);
      }
    }
  }
};

}  // namespace stiction::inline STICTION_ISA
