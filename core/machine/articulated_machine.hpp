#pragma once

#include <memory>

#include "core/job/articulated_job.hpp"
#include "core/job/articulated_reset_job.hpp"

namespace stiction {

/// Steps robots. Jobs name arrays in host memory, always the same but for masks and probes. A device has them in its
/// own memory, and the host's are copies.
template <class Real>
class ArticulatedMachine {
 public:
  virtual ~ArticulatedMachine() = default;
  /// `count` steps of all environments, or what a probe asks for, queued on a stream of the device.
  virtual void step(const ArticulatedJob<Real>& job, Offset env_count, Index count, StreamRef stream) = 0;
  /// Makes the host's array that begins there as steps have left it. Numbers that are written in it until the next call
  /// of step, reset, overwrite or view reach the steps.
  virtual void fetch(const void*) {}
  /// Resets environments of a mask for the steps to come. `job` names the host's arrays.
  virtual void reset(const ArticulatedResetJob<Real>& job, StreamRef stream) = 0;
  /// One of the host's arrays has the numbers of `from`, which is in the device's memory, for the steps to come.
  virtual void overwrite(void* array, const void* from, std::size_t bytes, StreamRef stream) = 0;
  /// The arrays that steps read and write, in memory of the device. `host` are the host's.
  virtual ArticulatedView<Real> view(const ArticulatedView<Real>& host) { return host; }
  /// Returns when all that was queued is done.
  virtual void synchronize() {}
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
