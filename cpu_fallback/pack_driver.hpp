#pragma once

#include <array>
#include <utility>

#include "core/body/lane_body.hpp"
#include "core/body/solve_body.hpp"
#include "cpu_fallback/job.hpp"
#include "cpu_fallback/pack_width.hpp"
#include "cpu_fallback/shared_bodies.hpp"

/// Feeds environments through the lanes of a pack. Compiled once per instruction set.
namespace stiction::inline STICTION_ISA {

template <class Real>
EnvView<Real> slice(const cpu::Job<Real>& job, Offset env) {
  return slice(job.batch, job.plan, job.law, job.warm_start, job.lambda, job.w, job.status, env);
}
/// The same for whoever is going to read all of A.
template <class Real>
EnvView<Real> slice_to_load(const cpu::Job<Real>& job, Offset env) {
  EnvView<Real> view = slice(job, env);
  if (job.plan.path[env] == EnvPath::dense) view.is_full = has_full_rows(view);
  return view;
}

/// Asks for the matrix of an environment that is to be loaded next, while others are worked on.
template <class Real>
void prefetch(const cpu::Job<Real>& job, Offset env) {
  constexpr Offset kMostBytes = 1 << 15;
  constexpr Offset kLine = 64;
  const EnvView<Real> view = slice(job, env);
  const auto ask = [](const auto* first, Offset count) {
    const auto* byte = reinterpret_cast<const char*>(first);
    const Offset bytes = count * static_cast<Offset>(sizeof(*first));
    for (Offset at = 0; at < bytes && at < kMostBytes; at += kLine) __builtin_prefetch(byte + at, 0, 2);
  };
  ask(view.A + view.row_offsets[0], view.entry_span());
  ask(view.columns(0), view.entry_span());
}

template <class Method, Law kLaw, class Real>
Offset pack_elements(const ConeCounts& slots) {
  return kPackWidth<Real> * DenseSystem<Real>::elements(slots, Method::room()) +
         LaneRows<Real>::elements(row_count(slots), kPackWidth<Real>);
}

/// One lane of a pack, as an environment's own system.
template <class Real>
using Lane = DenseSystem<Real, kPackWidth<Real>>;
template <class Real, int... kLanes>
std::array<Lane<Real>, kPackWidth<Real>> lanes_of(const ConeCounts& slots, const MethodRoom& room, Real* memory,
                                                  std::integer_sequence<int, kLanes...>) {
  return {Lane<Real>(slots, room, memory + kLanes)...};
}

/// The lanes that an environment is entering, as numbers are compared.
template <class Real, int W>
Mask<Pack<Real, W>> mask_of(const int* lanes, int count) {
  Pack<Real, W> marked(0);
  for (int k = 0; k < count; ++k) marked.v[lanes[k]] = Real(1);
  return marked > Pack<Real, W>(0);
}

/// Environments enter and leave lanes at chunk boundaries, so the vector stays nearly full until the run ends. Every
/// environment starts at a chunk boundary with its own count of iterations, so what it computes does not depend on its
/// lane, its neighbours or the moment it entered.
template <class Method, Law kLaw, class Real>
void solve_pack(const cpu::Job<Real>& job, const Offset* envs, Offset count, const ConeCounts& slots, Real* scratch) {
  constexpr int kWidth = kPackWidth<Real>;
  // Much of entering is done in all lanes whoever enters: lanes that become free wait until so many are.
  constexpr int kTogether = kWidth > 2 ? kWidth * 3 / 8 : 1;
  using Lanes = Pack<Real, kWidth>;
  const MethodParams<Real> params{job.omega, job.is_rung()};
  SerialBlock block;
  DenseSystem<Lanes> pack(slots, Method::room(), reinterpret_cast<Lanes*>(scratch));
  const Offset elements = kWidth * DenseSystem<Real>::elements(slots, Method::room());
  // Padding is zero. Idle lanes compute on whatever they hold, be it what a refused environment has left: masks keep it
  // out of every lane that counts.
  for (Offset i = 0; i < elements; ++i) scratch[i] = Real(0);

  struct Guest {
    EnvView<Real> env;
    StopRule rule;
    EnvProgress<Real> progress;
    bool busy = false;
    bool was_here = false;  ///< the lane's padding is that of env.counts
  };
  Guest guests[kWidth];
  Offset next = 0;
  int busy = 0;
  auto lanes = lanes_of<Real>(slots, Method::room(), scratch, std::make_integer_sequence<int, kWidth>{});
  /// The next environment that can be solved enters lane l as number k of those that enter with it, or none does.
  const auto enter = [&](int l, int k) {
    const LaneRows<Real> rows(scratch + elements, pack.n, kWidth, k);
    Guest& guest = guests[l];
    Lane<Real>& system = lanes[l];
    const LoadRules rules = load_rules<Method>(kLaw, system);
    while (next < count) {
      const EnvView<Real> env = slice_to_load(job, envs[next]);
      guest.rule = stop_rule(job, envs[next]);
      const bool is_laid_out = !guest.was_here || guest.env.counts == env.counts;
      guest.env = env;
      guest.was_here = true;
      guest.progress = EnvProgress<Real>{};
      if (++next < count) prefetch(job, envs[next]);
      guest.progress.flags = load_lane(env, system, rules, is_laid_out, rows) | unsupported_flags<Method>(system);
      if (is_solvable(guest.progress.flags)) return true;
      refuse(block, env, Method::kKind, guest.progress.flags);
    }
    return false;
  };

  for (;;) {
    for (int l = 0; l < kWidth; ++l) {
      Guest& guest = guests[l];
      if (guest.busy && settle<Method>(block, guest.env, lanes[l], guest.rule, guest.progress)) {
        guest.busy = false;
        --busy;
      }
    }
    while (next < count && busy <= kWidth - kTogether) {
      int entering[kWidth];
      int entering_count = 0;
      for (int l = 0; l < kWidth; ++l)
        if (!guests[l].busy && enter(l, entering_count)) entering[entering_count++] = l;
      deal_matrices<Real, kWidth>(scratch + elements, entering, entering_count, pack.n, lanes[0].A.data);
      begin_lanes<Method, kLaw>(pack, mask_of<Real, kWidth>(entering, entering_count));
      for (int k = 0; k < entering_count; ++k) {
        Guest& guest = guests[entering[k]];
        Lane<Real>& system = lanes[entering[k]];
        start_method<Method, kLaw>(block, guest.env, system);
        guest.busy = !settle<Method>(block, guest.env, system, guest.rule, guest.progress);
        busy += guest.busy ? 1 : 0;
      }
    }
    if (busy == 0) return;
    Lanes phase(0);
    Lanes left(0);
    for (int l = 0; l < kWidth; ++l) {
      if (!guests[l].busy) continue;
      phase.v[l] = static_cast<Real>(guests[l].progress.iterations % kRefreshInterval);
      left.v[l] = static_cast<Real>(guests[l].rule.max_iterations - guests[l].progress.iterations);
    }
    advance<Method, kLaw>(block, pack, params, phase, left);
    for (Guest& guest : guests)
      if (guest.busy) {
        const Index remaining = guest.rule.max_iterations - guest.progress.iterations;
        guest.progress.iterations += remaining < kChunk ? remaining : kChunk;
      }
  }
}

template <class Method, Law kLaw, class Real>
Offset one_elements(const cpu::Job<Real>& job, Offset env) {
  const EnvView<Real> view = slice(job, env);
  const MethodRoom room = Method::room().up_to(job.direct_rows);
  if (job.plan.path[env] == EnvPath::dense) return DenseSystem<Real>::elements(view.counts, room);
  if (job.plan.path[env] == EnvPath::factor)
    return FactorSystem<Real>::elements(view.n, view.cone_count, view.dofs, room);
  return SparseSystem<Real>::elements(view.n, view.cone_count, view.entry_span(), room);
}

template <class Method, Law kLaw, class Real>
void solve_one(const cpu::Job<Real>& job, Offset env, Real* scratch) {
  const StopRule rule = stop_rule(job, env);
  const MethodParams<Real> params{job.omega, job.is_rung()};
  const EnvView<Real> view = slice_to_load(job, env);
  const MethodRoom room = Method::room().up_to(job.direct_rows);
  SerialBlock block;
  if (job.plan.path[env] == EnvPath::empty) {
    answer_empty(block, view, Method::kKind);
  } else if (job.plan.path[env] == EnvPath::dense) {
    DenseSystem<Real> system(view.counts, room, scratch);
    solve_environment<Method, kLaw>(block, view, system, params, rule);
  } else if (job.plan.path[env] == EnvPath::factor) {
    FactorSystem<Real> system(view, room, scratch);
    solve_environment<Method, kLaw>(block, view, system, params, rule);
  } else {
    SparseSystem<Real> system(view, room, scratch);
    solve_environment<Method, kLaw>(block, view, system, params, rule);
  }
}

template <class Method, Law kLaw, class Real>
cpu::Kernels<Real> kernels() {
  cpu::Kernels<Real> table{1, nullptr, nullptr, nullptr, nullptr};
  if constexpr (!kPacksAlone) {
    table.one_elements = one_elements<Method, kLaw, Real>;
    table.solve_one = solve_one<Method, kLaw, Real>;
  }
  constexpr bool kPacks = 1 < kPackWidth<Real> && !Method::room().is_direct();
  if constexpr (kPacks) {
    table.pack_width = kPackWidth<Real>;
    table.pack_elements = pack_elements<Method, kLaw, Real>;
    table.solve_pack = solve_pack<Method, kLaw, Real>;
  }
  return table;
}

template <class Method>
cpu::KernelSet kernel_set() {
  return {{kernels<Method, Law::convex, float>(), kernels<Method, Law::coulomb, float>()},
          {kernels<Method, Law::convex, double>(), kernels<Method, Law::coulomb, double>()}};
}

}  // namespace stiction::inline STICTION_ISA
