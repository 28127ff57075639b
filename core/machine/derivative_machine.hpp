#pragma once

#include <memory>

#include "core/job/derivative_job.hpp"

namespace stiction {

/// Differentiates contact batches on one machine; everything was checked before.
class DerivativeMachine {
 public:
  virtual ~DerivativeMachine() = default;
  virtual void vjp(const VjpJob<float>& job) = 0;
  virtual void vjp(const VjpJob<double>& job) = 0;
  /// What the loss says of velocities becomes part of what it says of reactions.
  virtual void seed(const JacobianVjpJob<float>& job) = 0;
  virtual void seed(const JacobianVjpJob<double>& job) = 0;
  /// From the cotangent of b to those of J, M and v_free.
  virtual void chain(const JacobianVjpJob<float>& job) = 0;
  virtual void chain(const JacobianVjpJob<double>& job) = 0;
  virtual void jvp(const JvpJob<float>& job) = 0;
  virtual void jvp(const JvpJob<double>& job) = 0;
};

std::unique_ptr<DerivativeMachine> make_cpu_derivative_machine(int threads);

}  // namespace stiction
