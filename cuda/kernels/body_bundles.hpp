#pragma once

#include "core/algorithm/rigid/sequential_impulses.hpp"
#include "cuda/api/kernel.hpp"
#include "cuda/kernels/bodies_args.hpp"

namespace stiction::inline STICTION_ISA {

/// What a team keeps of its lanes' environments, at the head of its fast memory. Their numbers follow, each lane's
/// apart from its neighbours' by one: first those of Real, then those of double.
template <class Real>
struct BodyBundleHead {
  struct Slot {
    SiProgress<Real> progress;
    Offset env;
  };
  alignas(16) Slot slot[cuda::kWarp];
};

/// One lane per body environment, a warp of them in lock-step from chunk to chunk. What is unfinished is one bit per
/// slot, the same on every lane.
template <Law kLaw, class Real>
struct SolveBodyBundles {
  using Args = cuda::BodyBundleArgs<Real>;
  using Head = BodyBundleHead<Real>;
  using System = BodySystem<Real, kLaw, cuda::kWarp>;
  static constexpr bool kSerial = false;
  static constexpr Index kSlots = cuda::kWarp;
  /// Slots that are free before new environments are taken: while one lane loads, all others wait.
  static constexpr Index kIntake = 8;

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    Head& head = *static_cast<Head*>(id.shared);
    const SiParams params = si_params(args.job.stepping, args.job.options);
    std::uint32_t busy = 0;
    bool more = true;
    for (;;) {
      if (const Index free = kSlots - count_bits(busy); more && free >= kIntake) {
        const Offset first = args.queue.begin + team.fetch(args.queue.work_counter, free);
        more = first + free < args.queue.end;
        busy |= slots_where(team, ~busy, [&](Index index, std::uint32_t bit) {
          const Offset position = first + count_bits(~busy & (bit - 1U));
          if (position >= args.queue.end) return false;
          head.slot[index].env = args.queue.order[position];
          return on_slot(args, params, head, index, [&](auto&... state) { return start_bodies(state...); });
        });
      }
      if (busy == 0 && !more) return;
      busy = slots_where(team, busy, [&](Index index, std::uint32_t) {
        return on_slot(args, params, head, index, [&](auto&... state) { return !check_bodies(state...); });
      });
      slots_where(team, busy, [&](Index index, std::uint32_t) {
        return on_slot(args, params, head, index, [&](auto&... state) {
          advance_bodies(state...);
          return true;
        });
      });
    }
  }

 private:
  static_assert(kSlots == 32, "a slot is a bit");

  static STICTION_HD Index count_bits(std::uint32_t bits) {
    Index count = 0;
    for (; bits != 0; bits &= bits - 1U) ++count;
    return count;
  }

  /// f(index, bit) for the slots of a mask, shared out; the mask of those for which it was true, on every lane.
  template <Team TeamT, class F>
  static STICTION_HD std::uint32_t slots_where(TeamT& team, std::uint32_t mask, F&& f) {
    std::uint32_t mine = 0;
    for (Index index = team.rank(); index < kSlots; index += team.size()) {
      const std::uint32_t bit = std::uint32_t{1} << index;
      if ((mask & bit) != 0 && f(index, bit)) mine |= bit;
    }
    return team.combine(mine);
  }

  /// f(block, environment, system, params, progress) for what a slot holds.
  template <class F>
  static STICTION_HD bool on_slot(const Args& args, const SiParams& params, Head& head, Index index, F&& f) {
    SerialTeam team;
    typename Head::Slot& slot = head.slot[index];
    const BodyEnv<Real> env = slice_bodies(args.job, slot.env);
    Real* const numbers = reinterpret_cast<Real*>(&head + 1);
    double* const exact = reinterpret_cast<double*>(numbers + kSlots * args.slot_elements);
    const System system(env.kept, env.bodies, params, numbers + index, exact + index);
    return f(team, env, system, params, slot.progress);
  }
};

}  // namespace stiction::inline STICTION_ISA
