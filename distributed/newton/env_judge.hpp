#pragma once

#include <algorithm>
#include <vector>

#include "distributed/subdomains/one_env.hpp"

namespace stiction::distributed {

/// Judges impulses for one environment by a BodySolver without iterations.
template <class Real>
class EnvJudge {
 public:
  EnvJudge(const OneEnv<Real>& env, const TimeStepping& stepping, const BodySolverOptions& options)
      : env_(env), solver_(Device::cpu(), stepping, without_iterations(options)), plan_(solver_.plan(env.view)) {}

  /// Null: of none.
  EnvStatus verdict(const Real* impulses) {
    const auto contacts = static_cast<std::size_t>(env_.view.contact_count);
    judged_.impulse.resize(3 * contacts);
    judged_.w.resize(3 * contacts);
    judged_.twist.resize(6 * static_cast<std::size_t>(env_.view.body_count));
    judged_.status.resize(1);
    solver_.solve(
        plan_, env_.view,
        BodySolutionView<Real>{judged_.impulse.data(), judged_.twist.data(), judged_.w.data(), judged_.status.data()},
        impulses);
    return judged_.status.front();
  }
  /// Publishes the last judged impulses, with that status.
  void publish(const EnvStatus& status) const {
    const BodySolutionView<Real>& out = env_.solution;
    std::copy(judged_.impulse.begin(), judged_.impulse.end(), out.impulse);
    std::copy(judged_.twist.begin(), judged_.twist.end(), out.twist);
    if (out.w != nullptr) std::copy(judged_.w.begin(), judged_.w.end(), out.w);
    *out.status = status;
  }

 private:
  static BodySolverOptions without_iterations(BodySolverOptions options) {
    options.method = BodyMethod::impulses;
    options.iterations = 0;
    options.threads = 1;
    return options;
  }

  const OneEnv<Real>& env_;
  BodySolver solver_;
  BodyPlan plan_;
  BodySolution<Real> judged_;
};

}  // namespace stiction::distributed
