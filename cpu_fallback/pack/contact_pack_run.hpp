#pragma once

#include <array>
#include <new>
#include <utility>

#include "core/algorithm/driver/solve_environment.hpp"
#include "core/algorithm/pack/evaluate_lanes.hpp"
#include "core/algorithm/pack/lane_progress.hpp"
#include "core/algorithm/pack/load_lanes.hpp"
#include "core/base/extents.hpp"
#include "cpu_fallback/pack/pack_driver.hpp"
#include "cpu_fallback/pack/shared_lanes.hpp"
#include "cpu_fallback/tables/contact_kernels.hpp"
#include "cpu_fallback/tables/shared_instances.hpp"

/// Environments of contacts, given by their matrices, in the lanes of a pack. Compiled once per instruction set.
namespace stiction::inline STICTION_ISA {

template <class Real>
EnvView<Real> slice(const cpu::Job<Real>& job, Offset env) {
  return slice(job.batch, job.plan, job.law, job.warm_start, job.lambda, job.w, job.status, env);
}
/// One environment of the job, of which all of A is going to be read.
template <class Real>
EnvView<Real> slice_to_load(const cpu::Job<Real>& job, Offset env) {
  EnvView<Real> view = slice(job, env);
  const bool is_known = job.full_rows != nullptr && job.full_rows[env] == FullRows::known;
  if (job.plan.path[env] == EnvPath::dense) view.is_full = is_known || has_full_rows(view);
  return view;
}

template <class T>
void prefetch_span(const T* first, Offset count) {
  constexpr Offset kMostBytes = 1 << 15;
  constexpr Offset kLine = 64;
  const auto* byte = reinterpret_cast<const char*>(first);
  const Offset bytes = count * static_cast<Offset>(sizeof(T));
  for (Offset at = 0; at < bytes && at < kMostBytes; at += kLine) __builtin_prefetch(byte + at, 0, 3);
}
template <class Real>
void prefetch_matrix(const EnvView<Real>& env) {
  prefetch_span(env.A + env.row_offsets[0], env.entry_span());
}
/// Prefetches the numbers of an environment that is to be loaded soon, while others are worked on.
template <class Real>
void prefetch(const cpu::Job<Real>& job, Offset env) {
  const EnvView<Real> view = slice(job, env);
  prefetch_matrix(view);
  if (job.full_rows == nullptr || job.full_rows[env] != FullRows::known)
    prefetch_span(view.columns(0), view.entry_span());
  prefetch_span(view.row_offsets, view.n);
  prefetch_span(view.cone_rows, view.cone_count);
  prefetch_span(view.cone_order, view.cone_count);
  prefetch_span(view.kind, view.cone_count);
  for (const Real* numbers : {view.b, view.R, view.lo, view.hi}) prefetch_span(numbers, view.n);
  if (view.mu_offsets == nullptr) prefetch_span(view.mu, view.n);
  if (view.warm_start != nullptr) prefetch_span(view.warm_start, view.n);
}

/// One lane of a pack, as an environment's own system.
template <class Real>
using Lane = DenseSystem<Real, kPackWidth<Real>>;
template <class Real, int... kLanes>
std::array<Lane<Real>, kPackWidth<Real>> lanes_of(const ConeCounts& slots, const Workspace& workspace, Real* memory,
                                                  std::integer_sequence<int, kLanes...>) {
  return {Lane<Real>(slots, workspace, memory + kLanes)...};
}

template <class Method>
inline constexpr bool kIteratesOnPairs = requires { requires Method::kTakesPairs; };

/// A pack of environments that are given by their matrices.
template <class Method, Law kLaw, class Real>
class ContactPackRun : public PackDriver<ContactPackRun<Method, kLaw, Real>, kPackWidth<Real>> {
  using Driver = PackDriver<ContactPackRun, kPackWidth<Real>>;
  friend Driver;
  using Driver::busy_;
  using Driver::queue_;

 public:
  using Driver::kWidth;
  static constexpr bool kTakesPairs = kIteratesOnPairs<Method>;

  static Offset scratch_elements(const ConeCounts& slots) {
    return elements(slots) + PackWorkspace<Real, kWidth>::elements(row_count(slots), cone_count(slots));
  }

  ContactPackRun(const cpu::Job<Real>& job, EnvQueue& queue, const ConeCounts& slots, Real* scratch)
      : Driver(queue),
        job_(job),
        params_{job.omega, job.is_fallback_stage()},
        pack_(slots, Method::workspace(), reinterpret_cast<Lanes*>(scratch)),
        lanes_(lanes_of<Real>(slots, Method::workspace(), scratch, std::make_integer_sequence<int, kWidth>{})),
        workspace_(scratch + elements(slots), pack_.n, pack_.cones),
        rules_(load_rules<Method>(kLaw, lanes_[0])) {
    if (params_.is_fallback_stage) rules_.needs_symmetry = false;
    pack_.has_blocks = job.batch.block_visits > 1;
    // Padding is zero. Idle lanes compute on any numbers, be they those of a refused environment: masks keep them out
    // of every lane that counts.
    for (Offset i = 0; i < elements(slots); ++i) scratch[i] = Real(0);
    prefetch_ahead();
  }

  /// The next chunk of all lanes.
  void advance() { stiction::advance<Method, kLaw>(team_, params_, next()); }
  /// The next chunk of all lanes of two packs, which alternate.
  static void advance(ContactPackRun& a, ContactPackRun& b) {
    stiction::advance<Method, kLaw>(a.team_, a.params_, a.next(), b.next());
  }

 private:
  /// Much of loading is done in all lanes whichever load: lanes that become free wait until so many are.
  static constexpr int kTogether = kWidth > 2 ? (kWidth * 3 + 7) / 8 : 1;
  using Lanes = Pack<Real, kWidth>;

  struct LaneState {
    EnvView<Real> env;
    StopRule rule;
    std::uint32_t flags;
  };

  static Offset elements(const ConeCounts& slots) {
    return kWidth * DenseSystem<Real>::elements(slots, Method::workspace());
  }

  /// Prefetches as many environments as there are lanes, before they are needed.
  void prefetch_ahead() {
    EnvQueue& q = queue_;
    for (q.prefetched = larger_of(q.prefetched, q.next); q.prefetched < q.count && q.prefetched < q.next + kWidth;
         ++q.prefetched)
      prefetch(job_, q.envs[q.prefetched]);
  }

  /// Loads the next environments into all free lanes. Returns the lanes of those that can be solved.
  LaneSet load_free_lanes() {
    PendingLoad<Real> loads[kWidth];
    int load_count = 0;
    for (int l = 0; l < kWidth && !queue_.is_empty(); ++l) {
      if (busy_.has(l)) continue;
      LaneState& state = states_[l];
      const Offset env = queue_.take();
      ::new (static_cast<void*>(&state.env)) EnvView<Real>(slice_to_load(job_, env));  // made where it stays
      state.rule = stop_rule(job_, env);
      prefetch_matrix(state.env);
      loads[load_count++] = {&state.env, l, 0U, nullptr};
    }
    load_lanes_of(pack_, lanes_.data(), workspace_, rules_, loads, load_count);
    LaneSet loaded;
    for (int k = 0; k < load_count; ++k) {
      const int l = loads[k].lane;
      LaneState& state = states_[l];
      state.flags = loads[k].flags | unsupported_flags<Method>(state.env, lanes_[l]);
      if (is_solvable(state.flags)) {
        searches_.begin(l, state.rule);
        loaded.add(l);
      } else {
        reject(team_, state.env, Method::kKind, state.flags);
      }
    }
    const Mask<Lanes> loading = mask_of<Real, kWidth>(loaded);
    finish_lanes(pack_, workspace_, loading, kLaw);
    const EnvView<Real>* envs[kWidth];
    int lanes[kWidth];
    int count = 0;
    loaded.for_each([&](int l) {
      envs[count] = &states_[l].env;
      lanes[count++] = l;
    });
    start_lanes(pack_, workspace_, lanes_.data(), envs, lanes, count, loading);
    update_best<Method, kLaw>(team_, pack_, loading);
    loaded.for_each([&](int l) {
      start_method<Method, kLaw>(team_, states_[l].env, lanes_[l]);
      busy_.add(l);
    });
    prefetch_ahead();
    return loaded;
  }

  /// All lanes begin their chunks together.
  [[nodiscard]] LaneSet due() const { return busy_; }

  /// Checks the convergence of those lanes, and releases the finished ones.
  void check_convergence(LaneSet among) {
    const auto polls = poll_progress<Lanes>(pack_, searches_.limits, searches_.search);
    const LaneSet asked = among & LaneSet(lane_bits(or_(polls.has_candidate, polls.ended)));
    if (asked.is_empty()) return;
    const EnvView<Real>* envs[kWidth];
    int lanes[kWidth];
    int count = 0;
    asked.for_each([&](int l) {
      envs[l] = &states_[l].env;
      lanes[count++] = l;
    });
    FinalResidual evaluated[kWidth];
    evaluate_lanes<kLaw>(pack_, workspace_, envs, lanes, count, evaluated);
    asked.for_each([&](int l) {
      const LaneState& state = states_[l];
      EnvProgress<Real> progress = searches_.of(l, state.flags);
      const bool is_done = check_evaluated<Method>(team_, state.env, lanes_[l], state.rule, poll_of_lane(polls, l),
                                                   evaluated[l], progress);
      searches_.search.verified.v[l] = progress.verified;
      if (is_done) release(l);
    });
  }

  void release(int lane) {
    busy_.remove(lane);
    searches_.end(lane);
  }

  Advancing<DenseSystem<Lanes>> next() { return next_chunk<Method>(pack_, searches_.limits, searches_.search); }

  const cpu::Job<Real>& job_;
  MethodParams<Real> params_;
  SerialTeam team_;
  DenseSystem<Lanes> pack_;
  std::array<Lane<Real>, kWidth> lanes_;
  PackWorkspace<Real, kWidth> workspace_;
  LoadRules rules_;
  LaneSearch<Real, kWidth> searches_;
  LaneState states_[kWidth];
};

/// Returns true if environments of these slots go through two packs that alternate. Sweeps of a few cones wait for
/// each cone's roots and quotients. Environments of more cones wait for numbers that the first cache does not hold of
/// two packs. Only speed depends on it.
template <class Method, class Real>
bool takes_pairs(const ConeCounts& slots) {
  constexpr Offset kMostMatrixBytes = Offset{8} << 10;
  const Offset rows = row_count(slots);
  return kIteratesOnPairs<Method> &&
         rows * rows * kPackWidth<Real> * static_cast<Offset>(sizeof(Real)) <= kMostMatrixBytes;
}

template <class Method, Law kLaw, class Real>
Offset pack_elements(const ConeCounts& slots) {
  return (takes_pairs<Method, Real>(slots) ? 2 : 1) * ContactPackRun<Method, kLaw, Real>::scratch_elements(slots);
}

template <class Method, Law kLaw, class Real>
void solve_pack(const cpu::Job<Real>& job, const Offset* envs, Offset count, const ConeCounts& slots, Real* scratch) {
  using Run = ContactPackRun<Method, kLaw, Real>;
  EnvQueue queue{envs, count};
  run_packs<Run>(queue, takes_pairs<Method, Real>(slots),
                 [&](int k) { return Run(job, queue, slots, scratch + k * Run::scratch_elements(slots)); });
}

template <class Method, class Real>
Offset one_elements(const cpu::Job<Real>& job, Offset env) {
  const EnvView<Real> view = slice(job, env);
  const Workspace workspace = Method::workspace().up_to(job.direct_rows);
  if (job.plan.path[env] == EnvPath::dense) return DenseSystem<Real>::elements(view.counts, workspace);
  if (job.plan.path[env] == EnvPath::factor)
    return FactorSystem<Real>::elements(view.n, view.cone_count, view.dofs, workspace);
  return SparseSystem<Real>::elements(view.n, view.cone_count, view.entry_span(), workspace);
}

/// Solves one environment, under either law: the expensive part asks for the law once a sweep, or not at all.
template <class Method, class Real>
void solve_one(const cpu::Job<Real>& job, Offset env, Real* scratch) {
  const StopRule rule = stop_rule(job, env);
  const MethodParams<Real> params{job.omega, job.is_fallback_stage()};
  const EnvView<Real> view = slice_to_load(job, env);
  const Workspace workspace = Method::workspace().up_to(job.direct_rows);
  SerialTeam team;
  if (job.plan.path[env] == EnvPath::empty) {
    write_empty(team, view, Method::kKind);
  } else if (job.plan.path[env] == EnvPath::dense) {
    DenseSystem<Real> system(view.counts, workspace, scratch);
    solve_environment<Method, kLawOfSystem>(team, view, system, params, rule);
  } else if (job.plan.path[env] == EnvPath::factor) {
    FactorSystem<Real> system(view, workspace, scratch);
    solve_environment<Method, kLawOfSystem>(team, view, system, params, rule);
  } else {
    SparseSystem<Real> system(view, workspace, scratch);
    solve_environment<Method, kLawOfSystem>(team, view, system, params, rule);
  }
}

template <class Method, class Real>
cpu::SingleKernels<Real> single_kernels() {
  if constexpr (kPacksAlone) {
    return {};
  } else {
    return {one_elements<Method, Real>, solve_one<Method, Real>};
  }
}

template <class Method, Law kLaw, class Real>
cpu::PackKernels<Real> pack_kernels() {
  if constexpr (1 < kPackWidth<Real> && !kSinglesAlone && !Method::workspace().is_direct()) {
    return {kPackWidth<Real>, pack_elements<Method, kLaw, Real>, solve_pack<Method, kLaw, Real>};
  } else {
    return {};
  }
}

template <class Method>
cpu::KernelSet kernel_set() {
  constexpr Law kConvex = Law::convex, kCoulomb = Law::coulomb;
  return {{single_kernels<Method, float>(), single_kernels<Method, double>()},
          {{pack_kernels<Method, kConvex, float>(), pack_kernels<Method, kCoulomb, float>()},
           {pack_kernels<Method, kConvex, double>(), pack_kernels<Method, kCoulomb, double>()}}};
}

}  // namespace stiction::inline STICTION_ISA
