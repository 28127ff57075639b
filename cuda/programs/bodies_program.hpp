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
    for (;;) {
      const Offset position = args.begin + team.fetch(args.ticket);
      if (position >= args.end) return;
      const BodyEnv<Real> env = slice_bodies(args.job, args.order[position]);
      using System = BodySystem<Real, kLaw>;
      const bool momentum = args.job.options.momentum;
      Real* const numbers = reinterpret_cast<Real*>(memory);
      Real* const behind = numbers + System::elements(env.kept, env.bodies, momentum);
      System system(env.kept, env.bodies, momentum, numbers, reinterpret_cast<double*>(behind));
      solve_bodies(team, env, system, si_params(args.job.stepping, args.job.options));
    }
  }
};

}  // namespace stiction::inline STICTION_ISA
