#pragma once

#include <memory>

#include "core/machine/derivative_machine.hpp"
#include "cuda/api/device_api.hpp"
#include "cuda/api/kernel_catalogue.hpp"
#include "cuda/api/memory.hpp"

namespace stiction::cuda {

/// Differentiates contact batches on a device: one launch, in memory that is taken when it is made.
class DeviceDerivativeMachine final : public DerivativeMachine {
 public:
  /// `eager`: every call is complete on return, for a device that does nothing before it is waited for.
  DeviceDerivativeMachine(std::shared_ptr<DeviceApi> api, const Capacity& capacity, Index max_unknowns, bool eager);
  ~DeviceDerivativeMachine() override;

  void vjp(const VjpJob<float>& job, StreamRef stream) override;
  void vjp(const VjpJob<double>& job, StreamRef stream) override;
  void jvp(const JvpJob<float>& job, StreamRef stream) override;
  void jvp(const JvpJob<double>& job, StreamRef stream) override;
  void synchronize(StreamRef stream) override;

 private:
  template <class Job>
  void queue(const KernelRef& kernel, const Job& job, StreamHandle stream);

  std::shared_ptr<DeviceApi> api_;
  bool eager_;
  Index most_rows_, most_dofs_;
  Offset slot_ = 0;  ///< scratch of a team, in doubles
  double* scratch_ = nullptr;
  LaunchShape shape_;
  ArraySet set_;
  DeviceMemory memory_;
  Event done_;  ///< the scratch is free again
};

}  // namespace stiction::cuda
