#pragma once

#include <memory>
#include <vector>

#include "core/algorithm/driver/solve_environment.hpp"
#include "core/plan/plan.hpp"
#include "tests/support/plan_views.hpp"
#include "tests/support/small_systems.hpp"

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
    memory_.resize(static_cast<std::size_t>(size()));
    flags = prepare<Method, kLaw>(team, env, system());
  }
  Prepared(const Prepared&) = delete;
  Prepared& operator=(const Prepared&) = delete;

  System& system() {
    if (!system_) system_ = std::make_unique<System>(make());
    return *system_;
  }

  SerialTeam team;
  EnvView<Real> env;
  EnvStatus status{};
  std::uint32_t flags = 0;

 private:
  static constexpr bool kDense = System::kMaintainsMotion;

  [[nodiscard]] Offset size() const {
    if constexpr (kDense) {
      return System::elements(env.counts, Method::workspace());
    } else {
      return System::elements(env.n, env.cone_count, batch_.view().nonzero_count, Method::workspace());
    }
  }
  System make() {
    if constexpr (kDense) {
      return System(env.counts, Method::workspace(), memory_.data());
    } else {
      return System(env, Method::workspace(), memory_.data());
    }
  }

  ContactBatch<Real> batch_;
  PlanData plan_;
  std::vector<Real> warm_, lambda_, w_, memory_;
  std::unique_ptr<System> system_;
};

template <class Real>
using Dense = DenseSystem<Real>;

/// The final residual of the reactions in p.env.lambda.
template <class P>
FinalResidual final_residual_of(P& p) {
  return final_residual(p.team, p.env, residual_rows(p.team, p.env, p.system()), island_shares(p.system()),
                        error_scale_of(p.system()));
}

}  // namespace stiction::test
