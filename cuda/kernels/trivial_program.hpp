#pragma once

#include "core/algorithm/driver/check_convergence.hpp"
#include "core/algorithm/problem/slice.hpp"
#include "cuda/api/kernel.hpp"
#include "cuda/kernels/work_queue.hpp"

namespace stiction::cuda {

/// Arguments of answering the trivial class beside the job.
template <class Real>
struct TrivialArgs {
  SolveJob<Real> job;
  WorkQueue<Real> queue;
  const std::uint32_t* flags;  ///< flags of planning                                         (env_count)
  SolverKind solver;
};

}  // namespace stiction::cuda

namespace stiction::inline STICTION_ISA {

/// Answers environments that need no iteration: those without rows, and those that planning refused. An environment
/// whose structure is broken gets a status and nothing else, since the place of its rows is unknown.
template <class Real>
struct AnswerTrivial {
  using Args = cuda::TrivialArgs<Real>;
  static constexpr bool kSerial = true;

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    const int trivial = static_cast<int>(SizeClass::trivial);
    const Offset end = args.queue.class_begin[trivial + 1];
    for (Offset position = args.queue.class_begin[trivial] + id.index; position < end; position += id.count) {
      const Offset index = args.queue.order[position];
      const std::uint32_t flags = args.flags[index];
      if ((flags & kFlagBadStructure) != 0) {
        EnvView<Real> env{};
        env.status = args.job.status + index;
        const double infinite = __builtin_huge_val();
        write_status(team, env, EnvCode::invalid_input, args.solver, flags, 0, infinite, infinite);
      } else if (const EnvView<Real> env = slice(args.job, index); flags != 0) {
        reject(team, env, args.solver, flags);
      } else {
        write_empty(team, env, args.solver);
      }
    }
  }
};

}  // namespace stiction::inline STICTION_ISA
