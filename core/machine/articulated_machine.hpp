#pragma once

#include <memory>

#include "core/job/articulated_job.hpp"

namespace stiction {

/// Steps robots whose arrays are in host memory.
template <class Real>
class ArticulatedMachine {
 public:
  virtual ~ArticulatedMachine() = default;
  /// `count` steps of all environments, or what a probe asks for.
  virtual void step(const ArticulatedJob<Real>& job, Offset env_count, Index count) = 0;
};

template <class Real>
std::unique_ptr<ArticulatedMachine<Real>> make_cpu_articulated_machine(int threads);
/// `job` names all arrays that those of later steps may name, and its model outlives the machine.
template <class Real>
std::unique_ptr<ArticulatedMachine<Real>> make_emulated_articulated_machine(const ArticulatedJob<Real>& job,
                                                                            Offset env_count);
/// \throws Error(no_device) with the reason, Error(unsupported) in a build without CUDA.
template <class Real>
std::unique_ptr<ArticulatedMachine<Real>> make_cuda_articulated_machine(int ordinal, const ArticulatedJob<Real>& job,
                                                                        Offset env_count);

}  // namespace stiction
