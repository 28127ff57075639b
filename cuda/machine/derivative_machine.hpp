#pragma once

#include <memory>

#include "core/machine/derivative_machine.hpp"
#include "cuda/api/device_api.hpp"
#include "cuda/api/kernel_catalogue.hpp"
#include "cuda/api/memory.hpp"
#include "cuda/machine/jacobian_machine.hpp"

namespace stiction::cuda {

/// Where batches of J and M of one precision are assembled for their derivatives. It grows with the batches.
template <class Real>
struct JacobianRoom {
  JacobianCapacity capacity;
  Offset numbers = 0;  ///< room of `in` and of `out`
  std::unique_ptr<DeviceJacobianMachine<Real>> machine;
  DeviceMemory memory;
  Real* in = nullptr;   ///< from J and M to the contact batch
  Real* out = nullptr;  ///< and back
};

/// Differentiates contact batches on a device: one launch, in memory that is taken when it is made. For batches of J
/// and M two more come before it. What sweeps and relaxed reactions take beside grows with the calls.
class DeviceDerivativeMachine final : public DerivativeMachine {
 public:
  /// `eager`: every call is complete on return, for a device that does nothing before it is waited for.
  DeviceDerivativeMachine(std::shared_ptr<DeviceApi> api, const Capacity& capacity, const DerivativeOptions& options,
                          bool eager);
  ~DeviceDerivativeMachine() override;

  void vjp(const VjpJob<float>& job, StreamRef stream) override;
  void vjp(const VjpJob<double>& job, StreamRef stream) override;
  void jvp(const JvpJob<float>& job, StreamRef stream) override;
  void jvp(const JvpJob<double>& job, StreamRef stream) override;
  void vjp(const JacobianVjpJob<float>& job, StreamRef stream) override;
  void vjp(const JacobianVjpJob<double>& job, StreamRef stream) override;
  void jvp(const JacobianJvpJob<float>& job, StreamRef stream) override;
  void jvp(const JacobianJvpJob<double>& job, StreamRef stream) override;
  void unrolled_vjp(const UnrolledJob<float>& job, StreamRef stream) override;
  void unrolled_vjp(const UnrolledJob<double>& job, StreamRef stream) override;
  void synchronize(StreamRef stream) override;

 private:
  template <class Args>
  void queue(const KernelRef& kernel, const Args& args, Offset teams, StreamHandle stream);
  template <class Program, class Job>
  void queue_job(const KernelRef& kernel, const Job& job, StreamHandle stream);
  template <class Program, class Job, class Contact>
  void queue_contacts(const KernelRef& kernel, const Contact& contact, StreamHandle stream);
  template <class Program, class Real, class Job>
  void queue_jacobians(JacobianRoom<Real>& room, const KernelRef& kernel, Job job, StreamHandle stream);
  template <class Real>
  void queue_sweeps(const KernelRef& kernel, const UnrolledJob<Real>& job, StreamHandle stream);
  [[nodiscard]] const DerivativePair& kernels(Precision precision) const;
  [[nodiscard]] const KernelRef& unrolled_kernel(Precision precision) const;
  [[nodiscard]] Offset teams_for(Offset slot) const;
  template <class Real>
  void make_room(JacobianRoom<Real>& room, const JacobianBatchView<Real>& batch, Offset count, StreamHandle stream);
  void make_room(DeviceMemory& memory, Offset doubles, StreamHandle stream);

  std::shared_ptr<DeviceApi> api_;
  bool eager_;
  bool captured_ = false;  ///< graphs hold the memory that there is
  double kappa_;
  Index most_rows_, most_dofs_;
  Offset most_nonzeros_;
  Offset slot_ = 0;  ///< scratch of a team, in doubles
  double* scratch_ = nullptr;
  LaunchShape shape_;
  ArraySet set_;
  DeviceMemory memory_;
  DeviceMemory relaxed_;  ///< reactions of the relaxed problem, of the largest batch so far
  DeviceMemory tapes_;    ///< sweeps of every team, of the longest so far
  JacobianRoom<float> floats_;
  JacobianRoom<double> doubles_;
  Event done_;  ///< the scratch is free again
};

}  // namespace stiction::cuda
