#pragma once

#include <memory>

#include "core/job/unrolled_job.hpp"
#include "stiction/error.hpp"

namespace stiction {

/// Differentiates contact batches, and batches of J and M, on one machine; everything was checked before. Jobs of J and
/// M come with all but an assembly and memory for what is connected with it.
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
  /// Sweeps, on return. \throws Error(unsupported) from a machine that has them not.
  virtual void unrolled_vjp(const UnrolledJob<float>&, StreamRef) { refuse_sweeps(); }
  virtual void unrolled_vjp(const UnrolledJob<double>&, StreamRef) { refuse_sweeps(); }
  /// Returns when what was queued on `stream` is done.
  virtual void synchronize(StreamRef stream) = 0;

 private:
  [[noreturn]] static void refuse_sweeps() {
    throw Error(ErrorCode::unsupported,
                "unrolled_vjp: sweeps are differentiated on the CPU alone: give Device::cpu() and a batch in host "
                "memory, or use vjp(), the derivative of the solution");
  }
};

/// kappa: product of reaction and motion in the problem that is differentiated; 0: the exact one.
std::unique_ptr<DerivativeMachine> make_cpu_derivative_machine(int threads, double kappa);
/// \throws Error(no_device) with the reason, Error(unsupported) in a build without CUDA.
std::unique_ptr<DerivativeMachine> make_cuda_derivative_machine(int ordinal, const Capacity& capacity,
                                                                Index max_unknowns);
std::unique_ptr<DerivativeMachine> make_emulated_derivative_machine(const Capacity& capacity, Index max_unknowns);

}  // namespace stiction
