#pragma once

#include <vector>

#include "core/plan/plan.hpp"
#include "stiction/solver.hpp"
#include "tests/support/machines/library_instances.hpp"
#include "tests/support/machines/plan_views.hpp"
#include "tests/support/machines/stress_team.hpp"
#include "tests/support/systems/system_of.hpp"

namespace stiction::test {

/// Environment 0 of a host batch on a team of `width` threads that meet at barriers only. The algorithm itself solves
/// it on such a system. With a seed the threads disagree about speed. Every law, system and kTile costs a copy of it.
template <class Method, Law kLaw, class System, Index kTile = cuda::EmulatedTeam::kRowTile,
          class Real = typename System::Real>
Solution<Real> solve_on_lanes(const ContactBatch<Real>& batch, const SolverOptions& options, Index width,
                              std::uint64_t seed = 0, const std::vector<Real>& guess = {}) {
  constexpr Workspace kWorkspace = Method::workspace();
  const auto rows = static_cast<std::size_t>(batch.row_count());
  Solution<Real> solution{std::vector<Real>(rows), std::vector<Real>(rows), std::vector<EnvStatus>(1)};
  const PlanData plan = make_plan(batch.view());
  const EnvView<Real> env = slice(batch.view(), view_of(plan), kLaw, guess.empty() ? nullptr : guess.data(),
                                  solution.lambda.data(), solution.w.data(), solution.status.data(), Offset{0});
  const StopRule rule{options.tolerance, options.max_iterations, options.stall_window};
  // An algorithm that reads before it writes would show: no memory of a GPU is zero without being written.
  std::vector<Real> memory(static_cast<std::size_t>(elements_of<System>(env, kWorkspace)),
                           static_cast<Real>(__builtin_nan("")));
  const auto solve = [&](auto& team) {
    System system = system_of<System>(env, kWorkspace, memory.data());
    solve_environment<Method, kLaw>(team, env, system, MethodParams<Real>{static_cast<Real>(options.omega)}, rule);
  };
  run_stressed<kTile>(width, solve, seed);
  return solution;
}

}  // namespace stiction::test
