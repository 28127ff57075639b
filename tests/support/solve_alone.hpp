#pragma once

#include <utility>
#include <vector>

#include "core/algorithm/driver/solve_environment.hpp"
#include "core/plan/plan.hpp"
#include "stiction/solver.hpp"
#include "tests/support/jitter_team.hpp"
#include "tests/support/plan_views.hpp"
#include "tests/support/stress_team.hpp"

/// One environment of a host batch solved by an algorithm, on the path that the plan chooses, without the machine
/// around it.
namespace stiction::test {

/// run(make_block) decides on which blocks; what an algorithm reads before it writes would show.
template <class Method, Law kLaw, class Real, class Run>
void solve_one(const ContactBatch<Real>& batch, const SolverOptions& options, Offset environment,
               Solution<Real>& solution, Run&& run) {
  const auto view = batch.view();
  const PlanData plan = make_plan(view);
  const EnvView<Real> env = slice<Real>(view, view_of(plan), kLaw, nullptr, solution.lambda.data(), solution.w.data(),
                                        solution.status.data(), environment);
  const StopRule rule{options.tolerance, options.max_iterations, options.stall_window};
  std::vector<Real> memory;
  const auto workspace = [&](Offset elements) {
    memory.assign(static_cast<std::size_t>(elements), static_cast<Real>(__builtin_nan("")));
    return memory.data();
  };
  const auto solve_with = [&](const auto& loaded) {
    run([&](auto& team) {
      auto system = loaded;
      solve_environment<Method, kLaw>(team, env, system, MethodParams<Real>{static_cast<Real>(options.omega)}, rule);
    });
  };
  constexpr Workspace kWorkspace = Method::workspace();
  switch (plan.path[static_cast<std::size_t>(environment)]) {
    case EnvPath::dense:
      solve_with(
          DenseSystem<Real>(env.counts, kWorkspace, workspace(DenseSystem<Real>::elements(env.counts, kWorkspace))));
      break;
    case EnvPath::sparse:
      solve_with(SparseSystem<Real>(
          env, kWorkspace,
          workspace(SparseSystem<Real>::elements(env.n, env.cone_count, env.entry_span(), kWorkspace))));
      break;
    case EnvPath::factor:
      solve_with(FactorSystem<Real>(
          env, kWorkspace, workspace(FactorSystem<Real>::elements(env.n, env.cone_count, env.dofs, kWorkspace))));
      break;
    case EnvPath::empty:
      run([&](auto& team) { write_empty(team, env, Method::kKind); });
  }
}

/// On one lane; the answer is that environment's alone.
template <class Method, Law kLaw, class Real>
Solution<Real> solve_alone(const ContactBatch<Real>& batch, const SolverOptions& options, Offset environment = 0) {
  const auto rows = static_cast<std::size_t>(batch.row_count());
  Solution<Real> all{std::vector<Real>(rows), std::vector<Real>(rows),
                     std::vector<EnvStatus>(static_cast<std::size_t>(batch.env_count()))};
  solve_one<Method, kLaw>(batch, options, environment, all, [](const auto& program) {
    SerialTeam team;
    program(team);
  });
  const std::vector<Offset>& offsets = batch.arrays().env_row_offsets;
  const Offset first = offsets[static_cast<std::size_t>(environment)];
  const Offset last = offsets[static_cast<std::size_t>(environment) + 1];
  return {std::vector<Real>(all.lambda.begin() + first, all.lambda.begin() + last),
          std::vector<Real>(all.w.begin() + first, all.w.begin() + last),
          {all.status[static_cast<std::size_t>(environment)]}};
}

/// Environment 0 on a team of `width` threads that meet at barriers only; with `jitter` their speeds differ at random.
template <class Method, Law kLaw, class Real>
void solve_on_lanes(const ContactBatch<Real>& batch, const SolverOptions& options, Solution<Real>& solution,
                    Index width, bool jitter) {
  solve_one<Method, kLaw>(batch, options, 0, solution, [&](const auto& program) {
    if (jitter) {
      const auto make = [](TortureTeam& team, Index rank) {
        return JitterTeam<StressTeam<1>>(StressTeam<1>(team, rank), 42);
      };
      run_stressed(width, make, program);
    } else {
      run_stressed<1>(width, program);
    }
  });
}

}  // namespace stiction::test
