#pragma once

#include <optional>
#include <vector>

#include "core/job/workspace.hpp"
#include "cpu_fallback/tables/isa.hpp"
#include "stiction/solver.hpp"
#include "tests/support/machines/plan_views.hpp"
#include "tests/support/systems/small_systems.hpp"

/// One environment of a host batch solved by the library's kernels, without the machine around them.
namespace stiction::test {

/// Rules of kernels for an environment, where the solver's differ.
struct AloneRules {
  std::optional<EnvPath> path = {};  ///< none: the plan's
  Index direct_rows = kDirectRows;   ///< rows of the largest environment that gets a method's matrices
};
/// Without room for a matrix of the method's own.
inline constexpr AloneRules kWithoutMatrices{{}, 0};
inline constexpr AloneRules kSparse{EnvPath::sparse};
inline constexpr AloneRules kSparseWithoutMatrices{EnvPath::sparse, 0};

/// Solves one environment on one lane. A kernel that reads before it writes would show: its memory is NaN.
template <class Real>
Solution<Real> solve_alone(const ContactBatch<Real>& batch, const SolverOptions& options, Offset environment = 0,
                           const AloneRules& rules = {}) {
  const auto view = batch.view();
  PlanData plan = make_plan(view);
  const auto e = static_cast<std::size_t>(environment);
  if (rules.path) plan.path[e] = *rules.path;
  const auto rows = static_cast<std::size_t>(view.row_count);
  Solution<Real> all{std::vector<Real>(rows), std::vector<Real>(rows),
                     std::vector<EnvStatus>(static_cast<std::size_t>(view.env_count))};
  cpu::Job<Real> job{{view, view_of(plan), nullptr, all.lambda.data(), all.w.data(), all.status.data(),
                      options.tolerance, options.max_iterations, options.stall_window, static_cast<Real>(options.omega),
                      view.law}};
  job.direct_rows = rules.direct_rows;
  const cpu::KernelSet set = cpu::best_isa().kernels(options.solver);
  const cpu::SingleKernels<Real>& kernels = cpu::of_precision<Real>(set.single);
  std::vector<Real> memory(static_cast<std::size_t>(kernels.elements(job, environment)),
                           static_cast<Real>(__builtin_nan("")));
  kernels.solve(job, environment, memory.data());
  const auto first = static_cast<std::ptrdiff_t>(view.env_row_offsets[environment]);
  const auto last = static_cast<std::ptrdiff_t>(view.env_row_offsets[environment + 1]);
  return {std::vector<Real>(all.lambda.begin() + first, all.lambda.begin() + last),
          std::vector<Real>(all.w.begin() + first, all.w.begin() + last),
          {all.status[e]}};
}

/// The answer of an environment by itself in that precision.
template <class Real = double>
Solution<Real> solved_alone(const Environment<double>& environment, const SolverOptions& options, Law law = Law::convex,
                            const AloneRules& rules = {}) {
  return solve_alone(convert<Real>(batch_of({environment}, law)), options, 0, rules);
}

}  // namespace stiction::test
