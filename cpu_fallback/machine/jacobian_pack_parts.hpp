#pragma once

#include <span>
#include <vector>

#include "core/algorithm/derivative/jacobian_pack_limits.hpp"
#include "cpu_fallback/machine/large_parts.hpp"

namespace stiction::cpu {

/// Items of a batch that lanes differentiate: environments, and the parts of those that are too large for a lane.
template <class Real, class Job>
class JacobianPackParts {
 public:
  explicit JacobianPackParts(const Job& job) : job_(job) {
    const JacobianBatchView<Real>& batch = job.assembly.batch;
    std::vector<Offset> large;
    for (Offset env = 0; env < batch.env_count; ++env) {
      if (!takes_derivative(job, env)) continue;
      const LaneEnv<Real> whole = lane_env(batch, env);
      if (whole.dofs > kMostVelocityDofs) {
        large.push_back(env);
      } else if (takes_derivative_size(whole)) {
        parts_.push_back(whole);
      }
    }
    islands_.append(batch, large, parts_, [&job](const LaneEnv<Real>& part) { return takes_part(job, part); });
    sort_by_size(parts_);
    results_.resize(parts_.size());
    std::vector<double> scales(large.empty() ? 0 : static_cast<std::size_t>(batch.env_count));
    for (const Offset env : large) scales[static_cast<std::size_t>(env)] = free_motion(batch, env);
    for (std::size_t i = 0; i < parts_.size() && !large.empty(); ++i)
      results_[i].scale = scales[static_cast<std::size_t>(parts_[i].env)];
  }

  /// Sorted by size.
  [[nodiscard]] std::span<const LaneEnv<Real>> all() const { return parts_; }
  /// Result of each of them; to be filled.
  [[nodiscard]] JacobianPackResult* results() { return results_.data(); }

  /// Joins the results of each environment's parts, and writes down which are answered.
  void finish(std::uint8_t* answered) const {
    std::vector<JacobianPackResult> wholes(static_cast<std::size_t>(job_.assembly.batch.env_count));
    for (std::size_t i = 0; i < parts_.size(); ++i) {
      answered[parts_[i].env] = 1;
      join(wholes[static_cast<std::size_t>(parts_[i].env)], results_[i]);
    }
    for (Offset env = 0; env < job_.assembly.batch.env_count; ++env)
      if (answered[env] != 0) stiction::finish(job_, answered, env, wholes[static_cast<std::size_t>(env)]);
  }

 private:
  const Job& job_;
  std::vector<LaneEnv<Real>> parts_;
  std::vector<JacobianPackResult> results_;
  LargeParts<Real> islands_;
};

}  // namespace stiction::cpu
