#pragma once

#include <type_traits>

#include "core/algorithm/driver/check_convergence.hpp"
#include "core/algorithm/solver/method.hpp"
#include "core/algorithm/sweep/sweep.hpp"

namespace stiction::inline STICTION_ISA {

static_assert(kRefreshInterval % kChunk == 0);

/// Chunk of one method. An iteration of a method that factorises costs so much more than a check that by default it is
/// checked after every one.
template <class Method>
STICTION_HD constexpr Index chunk_of() {
  if constexpr (requires { Method::kChunk; }) {
    return Method::kChunk;
  } else {
    return Method::workspace().is_direct() ? 1 : kChunk;
  }
}

/// Ends a chunk, with `phase` as below. Refreshes the motion where that is due; in the lanes of `due`, records the
/// iterate and takes the method's subspace step.
template <class Method, Law kLaw, Team TeamT, class System>
STICTION_HD void end_chunk(TeamT& team, System& s, typename System::Real phase, Mask<typename System::Real> due) {
  using Real = typename System::Real;
  const auto stale = phase == Real(kRefreshInterval - chunk_of<Method>());
  if (any(stale)) Method::refresh(team, s, stale);
  if (any(due)) update_best<Method, kLaw>(team, s, due);
  if constexpr (requires { Method::template subspace_step<kLaw>(team, s, due); })
    Method::template subspace_step<kLaw>(team, s, due);
}

/// A system on its way through a chunk. Lanes may differ in `phase`, their iterations so far modulo the refresh
/// interval, and in `left`, those they still have. A lane that runs out inside the chunk is recorded at its last
/// iteration and ignored from then on.
template <class System>
struct Advancing {
  System& s;
  typename System::Real phase;
  typename System::Real left;
};

/// One chunk of iterations of one system, or of two that alternate.
template <class Method, Law kLaw, Team TeamT, class Real, class... Systems>
STICTION_HD void advance(TeamT& team, const MethodParams<Real>& params, Advancing<Systems>... each) {
  const auto count_down = [&](auto& one, bool is_last) {
    using Lanes = std::remove_reference_t<decltype(one.left)>;
    one.left = one.left - Lanes(1);
    if (is_last) {
      end_chunk<Method, kLaw>(team, one.s, one.phase, one.left >= Lanes(0));
    } else if (const auto due = one.left == Lanes(0); any(due)) {
      update_best<Method, kLaw>(team, one.s, due);
    }
  };
  auto&& systems = as_pair(each.s...);
  for (Index k = 1; k <= chunk_of<Method>(); ++k) {
    Method::template iterate<kLaw>(team, systems, params);
    (count_down(each, k == chunk_of<Method>()), ...);
  }
}

/// The next chunk of a system, whose iterations count as done from now on.
template <class Method, class System, class Tolerance, class Real = typename System::Real>
STICTION_HD Advancing<System> next_chunk(System& s, const Limits<Tolerance, Counts<Real>>& rule, Search<Real>& search) {
  static_assert((kRefreshInterval & (kRefreshInterval - 1)) == 0);
  const Counts<Real> left = rule.max_iterations - search.iterations;
  const Advancing<System> chunk{s, as_reals<Real>(search.iterations & (kRefreshInterval - 1)), as_reals<Real>(left)};
  search.iterations = search.iterations + min_(left, Counts<Real>(chunk_of<Method>()));
  return chunk;
}

/// The next chunk of one environment, whose state is `progress`.
template <class Method, Law kLaw, Team TeamT, class Real, class System>
STICTION_HD void advance_chunk(TeamT& team, System& s, const MethodParams<Real>& params, const StopRule& rule,
                               EnvProgress<Real>& progress) {
  advance<Method, kLaw>(team, params, next_chunk<Method>(s, rule, progress));
}

/// One environment whose system is loaded, `flags` being load_system()'s result.
template <class Method, Law kLaw, Team TeamT, class Real, class System>
STICTION_HD void solve_loaded(TeamT& team, const EnvView<Real>& env, System& s, const MethodParams<Real>& params,
                              const StopRule& rule, std::uint32_t flags) {
  if (!is_solvable(flags)) {
    reject(team, env, Method::kKind, flags);
    return;
  }
  begin_method<Method, kLaw>(team, env, s);
  EnvProgress<Real> progress;
  progress.flags = flags;
  while (!check_convergence<Method>(team, env, s, rule, progress))
    advance_chunk<Method, kLaw>(team, s, params, rule, progress);
}

/// One environment from its numbers to its status: run by a GPU thread, a GPU block and a CPU core.
template <class Method, Law kLaw, Team TeamT, class Real, class System>
STICTION_HD void solve_environment(TeamT& team, const EnvView<Real>& env, System& s, const MethodParams<Real>& params,
                                   const StopRule& rule) {
  LoadRules rules = load_rules<Method>(law_of<kLaw>(env), s);
  if (params.is_fallback_stage) rules.needs_symmetry = false;
  const std::uint32_t flags = load_system(team, env, s, rules) | unsupported_flags<Method>(env, s);
  solve_loaded<Method, kLaw>(team, env, s, params, rule, flags);
}

}  // namespace stiction::inline STICTION_ISA
