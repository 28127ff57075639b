#pragma once

#include <vector>

#include "core/body/solve_body.hpp"
#include "core/schedule/plan.hpp"
#include "stiction/solver.hpp"
#include "tests/support/plan_views.hpp"

namespace stiction::test {

/// Solves one environment of a host batch with a body on one lane, on the path that the plan chooses: what the CPU does
/// with a method that factorises, without threads, packs and the code around them. lambda and w are that environment's.
template <class Method, Law kLaw, class Real>
Solution<Real> solve_alone(const ContactBatch<Real>& batch, const SolverOptions& options, Offset environment = 0) {
  const auto view = batch.view();
  const PlanData plan = make_plan(view);
  const auto rows = static_cast<std::size_t>(batch.row_count());
  const auto envs = static_cast<std::size_t>(batch.env_count());
  Solution<Real> all{std::vector<Real>(rows), std::vector<Real>(rows), std::vector<EnvStatus>(envs)};
  const EnvView<Real> env = slice<Real>(view, view_of(plan), kLaw, nullptr, all.lambda.data(), all.w.data(),
                                        all.status.data(), environment);
  const StopRule rule{options.tolerance, options.max_iterations, options.stall_window};
  // What a body reads before it writes would show.
  std::vector<Real> memory;
  const auto room = [&](Offset elements) {
    memory.assign(static_cast<std::size_t>(elements), static_cast<Real>(__builtin_nan("")));
    return memory.data();
  };
  SerialBlock block;
  const auto run = [&](auto system) {
    solve_environment<Method, kLaw>(block, env, system, MethodParams<Real>{static_cast<Real>(options.omega)}, rule);
  };
  switch (plan.path[static_cast<std::size_t>(environment)]) {
    case EnvPath::dense:
      run(DenseSystem<Real>(env.counts, Method::kRoom, room(DenseSystem<Real>::elements(env.counts, Method::kRoom))));
      break;
    case EnvPath::sparse:
      run(SparseSystem<Real>(
          env, Method::kRoom,
          room(SparseSystem<Real>::elements(env.n, env.cone_count, env.entry_span(), Method::kRoom))));
      break;
    case EnvPath::factor:
      run(FactorSystem<Real>(env, Method::kRoom,
                             room(FactorSystem<Real>::elements(env.n, env.cone_count, env.dofs, Method::kRoom))));
      break;
    case EnvPath::empty:
      answer_empty(block, env, Method::kKind);
  }
  const auto first = static_cast<std::ptrdiff_t>(view.env_row_offsets[environment]);
  const auto last = static_cast<std::ptrdiff_t>(first + env.n);
  return {std::vector<Real>(all.lambda.begin() + first, all.lambda.begin() + last),
          std::vector<Real>(all.w.begin() + first, all.w.begin() + last),
          {all.status[static_cast<std::size_t>(environment)]}};
}

}  // namespace stiction::test
