#pragma once

#include "core/body/bodies/si_body.hpp"
#include "cuda/device/kernel.hpp"
#include "cuda/programs/bodies_args.hpp"

namespace stiction::inline STICTION_ISA {

/// One team per body environment at a time, from its numbers to its status.
template <Law kLaw, class Real>
struct SolveBodies {
  using Args = cuda::BodiesArgs<Real>;
  static constexpr bool kSerial = false;

  template <class Team>
  static STICTION_HD void run(Team& team, const cuda::TeamId& id, const Args& args) {
    std::byte* const memory = args.workspace + id.index * args.slot_bytes;
    const SiParams params = si_params(args.job.stepping, args.job.options);
    for (;;) {
      const Offset position = args.queue.begin + team.fetch(args.queue.ticket);
      if (position >= args.queue.end) return;
      const BodyEnv<Real> env = slice_bodies(args.job, args.queue.order[position]);
      using System = BodySystem<Real, kLaw>;
      Real* const numbers = reinterpret_cast<Real*>(memory);
      Real* const behind = numbers + System::elements(env.kept, env.bodies, params.momentum);
      const System system(env.kept, env.bodies, params, numbers, reinterpret_cast<double*>(behind));
      solve_bodies(team, env, system, params);
    }
  }
};

}  // namespace stiction::inline STICTION_ISA
