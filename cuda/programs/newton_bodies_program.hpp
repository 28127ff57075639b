#pragma once

#include "core/body/bodies/newton/newton_bodies.hpp"
#include "cuda/device/kernel.hpp"
#include "cuda/programs/bodies_args.hpp"

namespace stiction::inline STICTION_ISA {

/// One team per body environment at a time, by Newton's method in body space.
template <Law kLaw, class Real>
struct SolveBodiesNewton {
  using Args = cuda::BodiesArgs<Real>;
  static constexpr bool kSerial = false;

  template <class Team>
  static STICTION_HD void run(Team& team, const cuda::TeamId& id, const Args& args) {
    using System = BodySystem<Real, kLaw>;
    std::byte* const memory = args.workspace + id.index * args.slot_bytes;
    const SiParams params = si_params(args.job.stepping, args.job.options);
    for (;;) {
      const Offset position = args.queue.begin + team.fetch(args.queue.ticket);
      if (position >= args.queue.end) return;
      const BodyEnv<Real> env = slice_bodies(args.job, args.queue.order[position]);
      Real* const numbers = reinterpret_cast<Real*>(memory);
      Real* const behind = numbers + System::elements(env.kept, env.bodies, params.momentum);
      double* const exact = reinterpret_cast<double*>(behind);
      const System system(env.kept, env.bodies, params, numbers, exact);
      const SpaceRoom room(kLaw, env.kept, env.bodies, env.newton_stream, exact + System::exact_elements(env.bodies));
      solve_bodies_newton(team, env, system, params, args.job.options.space, room);
    }
  }
};

}  // namespace stiction::inline STICTION_ISA
