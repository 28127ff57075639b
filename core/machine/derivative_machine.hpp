#pragma once

#include <memory>

#include "core/job/unrolled_job.hpp"

namespace stiction {

/// Differentiates contact batches, and batches of J and M, on one machine; everything was checked before. Jobs of J
/// and M come with all but an assembly and its memory.
class DerivativeMachine {
 public:
  virtual ~DerivativeMachine() = default;
  virtual void vjp(const VjpJob<float>& job, StreamRef stream) = 0;
  virtual void vjp(const VjpJob<double>& job, StreamRef stream) = 0;
  virtual void jvp(const JvpJob<float>& job, StreamRef stream) = 0;
  virtual void jvp(const JvpJob<double>& job, StreamRef stream) = 0;
  virtual void vjp(const JacobianVjpJob<float>& job, StreamRef stream) = 0;
  virtual void vjp(const JacobianVjpJob<double>& job, StreamRef stream) = 0;
  virtual void jvp(const JacobianJvpJob<float>& job, StreamRef stream) = 0;
  virtual void jvp(const JacobianJvpJob<double>& job, StreamRef stream) = 0;
  /// Jobs of sweeps come with an order of cones if their batch is in host memory.
  virtual void unrolled_vjp(const UnrolledJob<float>& job, StreamRef stream) = 0;
  virtual void unrolled_vjp(const UnrolledJob<double>& job, StreamRef stream) = 0;
  /// Returns when the work queued on `stream` is done.
  virtual void synchronize(StreamRef stream) = 0;
};

/// kappa: product of reaction and motion in the problem that is differentiated; 0: the exact one.
std::unique_ptr<DerivativeMachine> make_cpu_derivative_machine(int threads, double kappa);
/// \throws Error(no_device) with the reason, Error(unsupported) in a build without CUDA.
std::unique_ptr<DerivativeMachine> make_cuda_derivative_machine(int ordinal, const Capacity& capacity,
                                                                const DerivativeOptions& options);
std::unique_ptr<DerivativeMachine> make_emulated_derivative_machine(const Capacity& capacity,
                                                                    const DerivativeOptions& options);

}  // namespace stiction
