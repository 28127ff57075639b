#pragma once

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
  return kPackWidth<Real> * (DenseSystem<Real>::elements(slots, Method::room()) +
                             DenseSystem<Real>::elements(slots, Method::room().to_load()));
}

/// Environments enter and leave lanes at chunk boundaries: a lane that has finished takes the next environment of the
/// run at once, so the vector stays full until the run ends. Every environment starts at a chunk boundary with its own
/// count of iterations, so what it computes does not depend on its lane, its neighbours or the moment it entered.
template <class Method, Law kLaw, class Real>
void solve_pack(const cpu::Job<Real>& job, const Offset* envs, Offset count, const ConeCounts& slots, Real* scratch) {
  constexpr int kWidth = kPackWidth<Real>;
  using Lanes = Pack<Real, kWidth>;
  const MethodParams<Real> params{job.omega, job.is_rung()};
  SerialBlock block;
  DenseSystem<Lanes> pack(slots, Method::room(), reinterpret_cast<Lanes*>(scratch));

  struct Lane {
    EnvView<Real> env;
    StopRule rule;
    EnvProgress<Real> progress;
    bool busy = false;
  };
  Lane lanes[kWidth];
  Offset next = 0;
  int busy = 0;
  // An environment is loaded where its numbers lie together and then moved into its lane, together with all others that
  // enter at the same time: in a lane every number has a cache line of its own, and each line is visited once.
  const Offset elements = DenseSystem<Real>::elements(slots, Method::room().to_load());
  Real* const staging = scratch + kWidth * DenseSystem<Real>::elements(slots, Method::room());
  // Idle lanes compute on whatever they hold; they must hold numbers only so that no slow path is taken.
  for (Offset i = 0; i < kWidth * elements; ++i) scratch[i] = staging[i] = Real(0);

  for (;;) {
    int entering[kWidth];
    int entering_count = 0;
    for (int l = 0; l < kWidth; ++l) {
      Lane& lane = lanes[l];
      const DenseSystem<Real, kWidth> system(slots, Method::room(), scratch + l);
      if (lane.busy && settle<Method>(block, lane.env, system, lane.rule, lane.progress)) {
        lane.busy = false;
        --busy;
      }
      // The first place is used again and again, so it stays in the nearest cache.
      DenseSystem<Real> staged(slots, Method::room().to_load(), staging + entering_count * elements);
      while (!lane.busy && next < count) {
        lane.rule = stop_rule(job, envs[next]);
        lane.env = slice_to_load(job, envs[next++]);
        if (next < count) prefetch(job, envs[next]);
        lane.progress = EnvProgress<Real>{};
        lane.progress.flags = prepare<Method, kLaw>(block, lane.env, staged);
        if (!is_solvable(lane.progress.flags)) {
          refuse(block, lane.env, Method::kKind, lane.progress.flags);
        } else if (!settle<Method>(block, lane.env, staged, lane.rule, lane.progress)) {
          lane.busy = true;
          ++busy;
          entering[entering_count++] = l;
        }
      }
    }
    if (entering_count > 0)
      for (Offset i = 0; i < elements; ++i)
        for (int k = 0; k < entering_count; ++k) {
          const int l = entering[k];
          scratch[i * kWidth + l] = staging[k * elements + i];
        }
    if (busy == 0) return;
    Lanes phase(0);
    Lanes left(0);
    for (int l = 0; l < kWidth; ++l) {
      if (!lanes[l].busy) continue;
      phase.v[l] = static_cast<Real>(lanes[l].progress.iterations % kRefreshInterval);
      left.v[l] = static_cast<Real>(lanes[l].rule.max_iterations - lanes[l].progress.iterations);
    }
    advance<Method, kLaw>(block, pack, params, phase, left);
    for (Lane& lane : lanes)
      if (lane.busy) {
        const Index remaining = lane.rule.max_iterations - lane.progress.iterations;
        lane.progress.iterations += remaining < kChunk ? remaining : kChunk;
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
  cpu::Kernels<Real> table{1, nullptr, one_elements<Method, kLaw, Real>, nullptr, solve_one<Method, kLaw, Real>};
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
