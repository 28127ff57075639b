#pragma once

#include <memory>

#include "core/job/articulated_job.hpp"

namespace stiction {

/// Steps robots in host memory.
template <class Real>
class ArticulatedMachine {
 public:
  virtual ~ArticulatedMachine() = default;
  /// `count` steps of all environments, or what a probe asks for.
  virtual void step(const ArticulatedJob<Real>& job, Offset env_count, Index count) = 0;
};

template <class Real>
std::unique_ptr<ArticulatedMachine<Real>> make_cpu_articulated_machine(int threads);

}  // namespace stiction
