#pragma once

#include "core/algorithm/rigid/sequential_impulses.hpp"
#include "cuda/api/kernel.hpp"
#include "cuda/kernels/bodies_args.hpp"
#include "cuda/kernels/warp_slots.hpp"

namespace stiction::inline STICTION_ISA {

/// State of its lanes' environments that a team keeps at the head of its fast memory. Their numbers follow, each
/// lane's apart from its neighbours' by one: first those of Real, then those of double.
template <class Real>
struct BodyBundleHead {
  struct Slot {
    SiProgress<Real> progress;
    Offset env;
  };
  alignas(16) Slot slot[kWarpSlots];
};

/// One lane per body environment, a warp of them in lock-step from chunk to chunk.
template <Law kLaw, class Real>
struct SolveBodyBundles {
  using Args = cuda::BodyBundleArgs<Real>;
  using Head = BodyBundleHead<Real>;
  using System = BodySystem<Real, kLaw, kWarpSlots>;
  static constexpr bool kSerial = false;
  static constexpr int kThreads = cuda::kTeamThreads;

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    Head& head = *static_cast<Head*>(id.shared);
    const SiParams params = si_params(args.job.stepping, args.job.options);
    const auto start = [&](Index index, Offset position) {
      head.slot[index].env = args.queue.order[position];
      return on_slot(args, params, head, index, [&](auto&... state) { return start_bodies(state...); });
    };
    const auto go_on = [&](Index index) {
      return on_slot(args, params, head, index, [&](auto&... state) {
        if (check_bodies(state...)) return false;
        advance_bodies(state...);
        return true;
      });
    };
    work_in_slots(team, args.queue.begin, args.queue.end, args.queue.work_counter, start, go_on);
  }

 private:
  /// f(block, environment, system, params, progress) for a slot's environment.
  template <class F>
  static STICTION_HD bool on_slot(const Args& args, const SiParams& params, Head& head, Index index, F&& f) {
    SerialTeam team;
    typename Head::Slot& slot = head.slot[index];
    const BodyEnv<Real> env = slice_bodies(args.job, slot.env);
    Real* const numbers = reinterpret_cast<Real*>(&head + 1);
    double* const exact = reinterpret_cast<double*>(numbers + kWarpSlots * args.slot_elements);
    const System system(env.kept, env.bodies, params, numbers + index, exact + index);
    return f(team, env, system, params, slot.progress);
  }
};

}  // namespace stiction::inline STICTION_ISA
