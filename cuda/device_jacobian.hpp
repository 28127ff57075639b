#pragma once

#include <memory>

#include "core/machine/jacobian_machine.hpp"
#include "cuda/device/kernels.hpp"
#include "cuda/device/memory.hpp"

namespace stiction::cuda {

/// Makes contact batches of Jacobian batches on a device: three launches, and one for the velocities. Memory is taken
/// when it is made.
template <class Real>
class DeviceJacobian final : public JacobianMachine<Real> {
 public:
  DeviceJacobian(std::shared_ptr<DeviceApi> api, const JacobianCapacity& capacity, FactorUse use);
  ~DeviceJacobian() override;

  ContactBatchView<Real> assemble(const JacobianBatchView<Real>& batch, StreamRef stream) override;
  void velocities(const JacobianBatchView<Real>& batch, const JacobianSolutionView<Real>& solution,
                  StreamRef stream) override;

 private:
  void launch(const KernelRef& kernel, const LaunchShape& shape, const JacobianBatchJob<Real>& job,
              StreamHandle stream);
  void finish(StreamHandle stream) noexcept;
  template <class Work>
  void queue(StreamHandle stream, const Work& work);

  std::shared_ptr<DeviceApi> api_;
  JacobianArrays<Real> arrays_{};
  Real* scratch_ = nullptr;  ///< of each team, null: in fast memory                   (teams * slot)
  Offset slot_ = 0;
  LaunchShape small_, large_;  ///< of counting; of assembling and moving
  ArraySet set_;
  DeviceMemory memory_;
  Event done_;  ///< the arrays are free again
};

}  // namespace stiction::cuda
