#pragma once

#include "core/algorithm/driver/register_chunk.hpp"
#include "core/algorithm/problem/slice.hpp"
#include "core/algorithm/system/dense_system.hpp"
#include "cuda/api/kernel.hpp"
#include "cuda/kernels/work_queue.hpp"

namespace stiction::cuda {

/// Environments that a team holds at once, one for each of its lanes.
inline constexpr Index kBundle = 128;
/// Environments that a team takes at a time.
inline constexpr Index kBundleIntake = 32;
static_assert(kBundle % kWarp == 0 && kBundle % kBundleIntake == 0);

}  // namespace stiction::cuda

namespace stiction::inline STICTION_ISA {

/// A bundle's bookkeeping, at the head of its team's fast memory.
template <class Real>
struct BundleHead {
  struct Slot {
    EnvProgress<Real> progress;
    unsigned char window;  ///< of registers that its iterations fit into, as register_capacity() says
    Offset env;
  };
  Slot slot[cuda::kBundle];
  Index order[cuda::kBundle];         ///< slots, those that hold an unfinished environment first
  unsigned char busy[cuda::kBundle];  ///< whether a slot's environment is unfinished
};

/// One lane per environment. Between chunks, once so many are finished that a warp could do without them, the
/// unfinished move together. The lanes set free take new environments, so that no warp waits for a slow lane while
/// there is work. What moves is the assignment of lanes to slots; an environment stays where it was loaded.
template <class Method, Law kLaw, class Real>
struct SolveThreadPerEnv {
  using Args = cuda::QueuedJob<Real>;
  using Head = BundleHead<Real>;
  static constexpr bool kSerial = false;
  static constexpr int kLanes = cuda::kBundle;

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    Head& head = *static_cast<Head*>(id.shared);
    const int size_class = static_cast<int>(args.queue.size_class);
    const Offset begin = args.queue.class_begin[size_class];
    const Offset end = args.queue.class_begin[size_class + 1];
    Real* const workspace = args.queue.workspace == nullptr
                                ? reinterpret_cast<Real*>(&head + 1)
                                : args.queue.workspace + id.index * (cuda::kBundle * args.queue.slot_elements);
    for_each(team, cuda::kBundle, [&](Index k) {
      head.order[k] = k;
      head.busy[k] = 0;
    });
    bool more = true;
    Index active = 0;
    for (;;) {
      Index taken = 0;
      while (more && active + taken + cuda::kBundleIntake <= cuda::kBundle) {
        const Offset first = begin + cuda::kBundleIntake * team.fetch(args.queue.work_counter + size_class);
        const Offset rest = end - first;
        const Index count = rest < cuda::kBundleIntake ? static_cast<Index>(rest) : cuda::kBundleIntake;
        more = count > 0;
        for (Index k = team.rank(); k < count; k += team.size())
          head.slot[head.order[active + taken + k]].env = args.queue.order[first + k];
        if (more) taken += count;
      }
      team.sync();
      for_each(team, taken, [&](Index k) {
        const Index slot = head.order[active + k];
        head.busy[slot] = load(args, workspace, slot, head.slot[slot]);
      });
      active += taken;
      if (active == 0) return;
      for_each(team, active, [&](Index k) {
        const Index slot = head.order[k];
        if (head.busy[slot] != 0) head.busy[slot] = go_on(args, workspace, slot, head.slot[slot]);
      });
      active = compact(team, head, active, more);
    }
  }

 private:
  static STICTION_HD DenseSystem<Real, cuda::kWarp> system_of(const Args& args, Real* workspace, Index slot,
                                                              const EnvView<Real>& env) {
    // 32 slots interleave their numbers, so that lanes in lock-step touch neighbouring addresses.
    Real* const memory = workspace + slot / cuda::kWarp * (cuda::kWarp * args.queue.slot_elements) + slot % cuda::kWarp;
    return DenseSystem<Real, cuda::kWarp>(env.counts, Method::workspace(), memory);
  }

  /// Loads an environment; whether there is anything left to do.
  static STICTION_HD unsigned char load(const Args& args, Real* workspace, Index index, typename Head::Slot& slot) {
    SerialTeam team;
    const EnvView<Real> env = slice(args.job, slot.env);
    auto system = system_of(args, workspace, index, env);
    slot.progress = EnvProgress<Real>{};
    slot.progress.flags = prepare<Method, kLaw>(team, env, system);
    if (!is_solvable(slot.progress.flags)) {
      reject(team, env, Method::kKind, slot.progress.flags);
      return 0;
    }
    if constexpr (kHasWindows<Method, Real>) slot.window = static_cast<unsigned char>(register_capacity(system));
    return check_convergence<Method>(team, env, system, stop_rule(args.job, slot.env), slot.progress) ? 0 : 1;
  }

  /// One chunk; whether there is anything left to do.
  static STICTION_HD unsigned char go_on(const Args& args, Real* workspace, Index index, typename Head::Slot& slot) {
    SerialTeam team;
    const EnvView<Real> env = slice(args.job, slot.env);
    auto system = system_of(args, workspace, index, env);
    const StopRule rule = stop_rule(args.job, slot.env);
    const MethodParams<Real> params{args.job.omega, args.job.is_fallback_stage()};
    if constexpr (kHasWindows<Method, Real>) {
      advance_chunk<Method, kLaw>(team, system, params, rule, slot.progress, slot.window);
    } else {
      advance_chunk<Method, kLaw>(team, system, params, rule, slot.progress);
    }
    return check_convergence<Method>(team, env, system, rule, slot.progress) ? 0 : 1;
  }

  /// Moves the unfinished to the front if that frees a warp, or lanes for new environments. Returns how many are to be
  /// looked at from now on.
  template <Team TeamT>
  static STICTION_HD Index compact(TeamT& team, Head& head, Index active, bool more) {
    Index mine = 0;
    for (Index k = team.rank(); k < active; k += team.size()) mine += head.busy[head.order[k]];
    const Index unfinished = team.total(mine);
    const Index warps = (active + cuda::kWarp - 1) / cuda::kWarp;
    const bool frees_a_warp = (unfinished + cuda::kWarp - 1) / cuda::kWarp < warps;
    const bool takes_more = more && unfinished + cuda::kBundleIntake <= cuda::kBundle;
    if (!frees_a_warp && !takes_more) return active;
    single(team, [&] {
      Index front = 0;
      for (Index k = 0; k < active; ++k) {
        const Index slot = head.order[k];
        if (head.busy[slot] == 0) continue;
        head.order[k] = head.order[front];
        head.order[front] = slot;
        ++front;
      }
    });
    return unfinished;
  }
};

}  // namespace stiction::inline STICTION_ISA
