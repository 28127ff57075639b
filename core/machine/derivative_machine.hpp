#pragma once

#include <memory>

#include "core/job/derivative_job.hpp"

namespace stiction {

/// Differentiates contact batches on one machine; everything was checked before.
class DerivativeMachine {
 public:
  virtual ~DerivativeMachine() = default;
  virtual void vjp(const VjpJob<float>& job, StreamRef stream) = 0;
  virtual void vjp(const VjpJob<double>& job, StreamRef stream) = 0;
  virtual void jvp(const JvpJob<float>& job, StreamRef stream) = 0;
  virtual void jvp(const JvpJob<double>& job, StreamRef stream) = 0;
  /// Returns when what was queued on `stream` is done.
  virtual void synchronize(StreamRef stream) = 0;
};

/// What the loss says of velocities becomes part of what it says of reactions.
template <class Real>
void seed_on_cpu(const JacobianVjpJob<Real>& job, int threads);
/// From the cotangent of b to those of J, M and v_free.
template <class Real>
void chain_on_cpu(const JacobianVjpJob<Real>& job, int threads);

std::unique_ptr<DerivativeMachine> make_cpu_derivative_machine(int threads);
/// \throws Error(no_device) with the reason, Error(unsupported) in a build without CUDA.
std::unique_ptr<DerivativeMachine> make_cuda_derivative_machine(int ordinal, const Capacity& capacity,
                                                                Index max_unknowns);
std::unique_ptr<DerivativeMachine> make_emulated_derivative_machine(const Capacity& capacity, Index max_unknowns);

}  // namespace stiction
