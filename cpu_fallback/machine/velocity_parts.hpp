#pragma once

#include <span>
#include <vector>

#include "core/algorithm/jacobian/jacobian_batch.hpp"
#include "core/algorithm/velocity/blocks/block_limits.hpp"
#include "core/algorithm/velocity/evaluate/velocity_result.hpp"
#include "cpu_fallback/machine/large_parts.hpp"

namespace stiction::cpu {

/// Items of a batch that Newton's method in velocities takes: environments, and the parts of those that are too large
/// for a lane. It takes all of an environment, or nothing.
template <class Real>
class VelocityParts {
 public:
  /// Sorted by size. flags: of each environment.
  std::span<const LaneEnv<Real>> list(const VelocityJob<Real>& job, const std::uint32_t* flags) {
    parts_.clear();
    large_.clear();
    for (Offset env = 0; env < job.batch.env_count; ++env) {
      if ((flags[env] & kNotAssembled) != 0 || !takes_form(job.batch, env)) continue;
      const LaneEnv<Real> whole = lane_env(job.batch, env);
      if (whole.dofs > kMostVelocityDofs) {
        large_.push_back(env);
      } else if (takes_size(job.batch, whole, job.law)) {
        parts_.push_back(whole);
      }
    }
    islands_.append(job.batch, large_, parts_,
                    [&](const LaneEnv<Real>& part) { return takes_size(job.batch, part, job.law); });
    results_.assign(parts_.size(), VelocityResult{});
    for (std::size_t i = 0; i < results_.size(); ++i) parts_[i].result = &results_[i];
    sort_by_size(parts_);
    return parts_;
  }

  /// Environments without answer that the method takes in blocks.
  std::span<const LaneEnv<Real>> list_blocks(const VelocityJob<Real>& job, const std::uint32_t* flags) {
    parts_.clear();
    for (Offset env = 0; env < job.batch.env_count; ++env) {
      if (job.answered[env] != 0 || (flags[env] & kNotAssembled) != 0 || !takes_form(job.batch, env)) continue;
      const LaneEnv<Real> whole = lane_env(job.batch, env);
      if (takes_blocks(whole)) parts_.push_back(whole);
    }
    return parts_;
  }

  /// Joins the results of each environment's parts, and writes down which are answered.
  void finish(const VelocityJob<Real>& job) {
    wholes_.assign(static_cast<std::size_t>(job.batch.env_count), VelocityResult{});
    for (const LaneEnv<Real>& part : parts_) {
      job.answered[part.env] = 1;
      join(wholes_[static_cast<std::size_t>(part.env)], *part.result);
    }
    for (Offset env = 0; env < job.batch.env_count; ++env)
      if (job.answered[env] != 0) stiction::finish(job, env, wholes_[static_cast<std::size_t>(env)]);
  }

 private:
  std::vector<LaneEnv<Real>> parts_;
  std::vector<VelocityResult> results_, wholes_;  ///< of each part, of each environment
  std::vector<Offset> large_;                     ///< environments that are looked at for parts
  LargeParts<Real> islands_;
};

}  // namespace stiction::cpu
