#pragma once

#include <vector>

#include "core/algorithm/driver/solve_environment.hpp"
#include "core/plan/plan.hpp"
#include "tests/support/plan_views.hpp"
#include "tests/support/small_systems.hpp"

namespace stiction::test {

/// What an algorithm makes of one environment on a team of one, dense or sparse as asked: no solver, no machine.
template <class Method, Law kLaw, class Real, template <class> class SystemOf>
Solution<Real> solved_alone(const Environment<double>& environment, double tolerance, Index max_iterations) {
  const ContactBatch<Real> batch = convert<Real>(batch_of({environment}, kLaw));
  const auto view = batch.view();
  const PlanData plan = make_plan(view);
  const auto rows = static_cast<std::size_t>(view.row_count);
  Solution<Real> solution{std::vector<Real>(rows), std::vector<Real>(rows), std::vector<EnvStatus>(1)};
  const EnvView<Real> env = slice(view, view_of(plan), kLaw, static_cast<const Real*>(nullptr), solution.lambda.data(),
                                  solution.w.data(), solution.status.data(), Offset{0});
  using System = SystemOf<Real>;
  const auto solve_on = [&](Offset elements, const auto& make) {
    std::vector<Real> memory(static_cast<std::size_t>(elements), static_cast<Real>(__builtin_nan("")));
    System system = make(memory.data());
    SerialTeam team;
    solve_environment<Method, kLaw>(team, env, system, MethodParams<Real>{Real(1)},
                                    StopRule{tolerance, max_iterations, 0});
  };
  if constexpr (System::kMaintainsMotion) {
    solve_on(System::elements(env.counts, Method::workspace()),
             [&](Real* memory) { return System(env.counts, Method::workspace(), memory); });
  } else {
    solve_on(System::elements(env.n, env.cone_count, view.nonzero_count, Method::workspace()),
             [&](Real* memory) { return System(env, Method::workspace(), memory); });
  }
  return solution;
}

template <class Real>
using OnDense = DenseSystem<Real>;

}  // namespace stiction::test
