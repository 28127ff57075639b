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
      const SiParams params = si_params(args.job.stepping, args.job.options);
      Real* const numbers = reinterpret_cast<Real*>(memory);
      Real* const behind = numbers + System::elements(env.kept, env.bodies, params.momentum);
      const System system(env.kept, env.bodies, params, numbers, reinterpret_cast<double*>(behind));
      solve_bodies(team, env, system, params);
    }
  }
};

}  // namespace stiction::inline STICTION_ISA
