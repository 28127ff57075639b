#pragma once

#include "core/algorithm/rigid/body_env.hpp"
#include "cuda/api/kernel.hpp"
#include "cuda/kernels/bodies_args.hpp"

namespace stiction::inline STICTION_ISA {

/// One team per body environment at a time, from its numbers to its status, by BodySweeps or BodyNewton.
template <class Method>
struct SolveBodies {
  using Real = typename Method::Real;
  using Args = cuda::BodiesArgs<Real>;
  static constexpr bool kSerial = false;
  static constexpr bool kTakesDevice = true;  ///< where an environment is large

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    std::byte* const memory = args.workspace + id.index * args.slot_bytes;
    Real* const numbers = reinterpret_cast<Real*>(memory);
    for (;;) {
      const Offset position = args.queue.begin + team.fetch(args.queue.work_counter);
      if (position >= args.queue.end) return;
      const BodyEnv<Real> env = slice_bodies(args.job, args.queue.order[position]);
      Real* const behind = numbers + Method::System::elements(env.kept, env.bodies, args.job.options.momentum);
      Method::solve(team, args.job, env, numbers, reinterpret_cast<double*>(behind));
    }
  }
};

}  // namespace stiction::inline STICTION_ISA
