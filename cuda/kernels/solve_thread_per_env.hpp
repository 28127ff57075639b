#pragma once

#include "core/algorithm/driver/register_chunk.hpp"
#include "core/algorithm/problem/slice.hpp"
#include "core/algorithm/system/dense_system.hpp"
#include "cuda/api/kernel.hpp"
#include "cuda/kernels/warp_slots.hpp"
#include "cuda/kernels/work_queue.hpp"

namespace stiction::inline STICTION_ISA {

/// State of its environments that a warp keeps at the head of its fast memory.
template <class Real>
struct BundleHead {
  struct Slot {
    EnvProgress<Real> progress;
    unsigned char window;  ///< of registers that its iterations fit into, by register_capacity()
    Offset env;
  };
  Slot slot[kWarpSlots];
};

/// One lane per environment, a warp of them in lock-step from chunk to chunk. An environment stays where it was loaded;
/// a lane that has finished waits until some others have, then they load the next.
template <class Method, Law kLaw, class Real>
struct SolveThreadPerEnv {
  using Args = cuda::QueuedJob<Real>;
  using Head = BundleHead<Real>;
  static constexpr bool kSerial = false;
  static constexpr int kThreads = cuda::kTeamThreads;

  template <Team TeamT>
  static STICTION_HD void run(TeamT& team, const cuda::TeamId& id, const Args& args) {
    Head& head = *static_cast<Head*>(id.shared);
    const int size_class = static_cast<int>(args.queue.size_class);
    Real* const workspace = args.queue.workspace == nullptr
                                ? reinterpret_cast<Real*>(&head + 1)
                                : args.queue.workspace + id.index * (kWarpSlots * args.queue.slot_elements);
    work_in_slots(
        team, args.queue.class_begin[size_class], args.queue.class_begin[size_class + 1],
        args.queue.work_counter + size_class,
        [&](Index index, Offset position) {
          head.slot[index].env = args.queue.order[position];
          return load(args, workspace + index, head.slot[index]);
        },
        [&](Index index) { return go_on(args, workspace + index, head.slot[index]); });
  }

 private:
  /// A slot's numbers, apart from each other by the number of slots: lanes in lock-step touch neighbouring addresses.
  static STICTION_HD DenseSystem<Real, kWarpSlots> system_of(Real* memory, const EnvView<Real>& env) {
    return DenseSystem<Real, kWarpSlots>(env.counts, Method::workspace(), memory);
  }

  /// Loads an environment; whether there is anything left to do.
  static STICTION_HD bool load(const Args& args, Real* memory, typename Head::Slot& slot) {
    SerialTeam team;
    const EnvView<Real> env = slice(args.job, slot.env);
    auto system = system_of(memory, env);
    slot.progress = EnvProgress<Real>{};
    slot.progress.flags = prepare<Method, kLaw>(team, env, system);
    if (!is_solvable(slot.progress.flags)) {
      reject(team, env, Method::kKind, slot.progress.flags);
      return false;
    }
    if constexpr (kHasWindows<Method, Real>) slot.window = static_cast<unsigned char>(register_capacity(system));
    return !check_convergence<Method>(team, env, system, stop_rule(args.job, slot.env), slot.progress);
  }

  /// One chunk; whether there is anything left to do.
  static STICTION_HD bool go_on(const Args& args, Real* memory, typename Head::Slot& slot) {
    SerialTeam team;
    const EnvView<Real> env = slice(args.job, slot.env);
    auto system = system_of(memory, env);
    const StopRule rule = stop_rule(args.job, slot.env);
    const MethodParams<Real> params{args.job.omega, args.job.is_fallback_stage()};
    if constexpr (kHasWindows<Method, Real>) {
      advance_chunk<Method, kLaw>(team, system, params, rule, slot.progress, slot.window);
    } else {
      advance_chunk<Method, kLaw>(team, system, params, rule, slot.progress);
    }
    return !check_convergence<Method>(team, env, system, rule, slot.progress);
  }
};

}  // namespace stiction::inline STICTION_ISA
