#pragma once

#include <memory>
#include <vector>

#include "core/plan/plan.hpp"
#include "tests/support/machines/library_instances.hpp"
#include "tests/support/machines/plan_views.hpp"
#include "tests/support/systems/small_systems.hpp"
#include "tests/support/systems/system_of.hpp"

namespace stiction::test {

/// One environment brought into the solver's coordinates by the algorithms themselves, so that a test can see them
/// from inside. System is DenseSystem<Real> or SparseSystem<Real>, whatever path the plan would choose.
template <class Method, Law kLaw, template <class> class SystemOf, class Real = double>
class Prepared {
 public:
  using System = SystemOf<Real>;

  explicit Prepared(const Environment<double>& environment, const std::vector<double>& warm_start = {})
      : batch_(convert<Real>(batch_of({environment}, kLaw))),
        plan_(make_plan(batch_.view())),
        warm_(warm_start.begin(), warm_start.end()),
        lambda_(static_cast<std::size_t>(batch_.row_count())),
        w_(lambda_.size()) {
    env = slice(batch_.view(), view_of(plan_), kLaw, warm_.empty() ? nullptr : warm_.data(), lambda_.data(), w_.data(),
                &status, Offset{0});
    memory_.resize(static_cast<std::size_t>(elements_of<System>(env, Method::workspace())));
    flags = prepare<Method, kLaw>(team, env, system());
  }
  Prepared(const Prepared&) = delete;
  Prepared& operator=(const Prepared&) = delete;

  System& system() {
    if (!system_) system_ = std::make_unique<System>(system_of<System>(env, Method::workspace(), memory_.data()));
    return *system_;
  }

  SerialTeam team;
  EnvView<Real> env;
  EnvStatus status{};
  std::uint32_t flags = 0;

 private:
  ContactBatch<Real> batch_;
  PlanData plan_;
  std::vector<Real> warm_, lambda_, w_, memory_;
  std::unique_ptr<System> system_;
};

/// The final residual of the reactions in p.env.lambda.
template <class P>
FinalResidual final_residual_of(P& p) {
  return final_residual(p.team, p.env, residual_rows(p.team, p.env, p.system()), island_shares(p.system()),
                        error_scale_of(p.system()));
}

}  // namespace stiction::test
