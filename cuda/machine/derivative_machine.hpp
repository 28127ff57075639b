#pragma once

#include <memory>

#include "core/base/extents.hpp"
#include "core/machine/derivative_machine.hpp"
#include "cuda/api/device_api.hpp"
#include "cuda/api/kernel_catalogue.hpp"
#include "cuda/api/memory.hpp"
#include "cuda/kernels/derivative_lanes_program.hpp"
#include "cuda/machine/jacobian_machine.hpp"

namespace stiction::cuda {

/// Numbers between the parts of a call that differentiates J and M.
struct JacobianNumbers {
  Offset rows = 0;      ///< of all sets
  Offset adjoints = 0;  ///< degrees of freedom of all sets
  Offset dofs = 0;

  [[nodiscard]] bool holds(const JacobianNumbers& other) const noexcept {
    return rows >= other.rows && adjoints >= other.adjoints && dofs >= other.dofs;
  }
  void take_in(const JacobianNumbers& other) noexcept {
    rows = larger_of(rows, other.rows);
    adjoints = larger_of(adjoints, other.adjoints);
    dofs = larger_of(dofs, other.dofs);
  }
};

/// Memory in which batches of J and M of one precision are assembled for their derivatives. It grows with the batches.
template <class Real>
struct JacobianRoom {
  JacobianCapacity capacity;
  JacobianNumbers has;
  std::unique_ptr<DeviceJacobianMachine<Real>> machine;
  DeviceMemory memory;
  Real* in = nullptr;              ///< from J and M to the contact batch
  Real* out = nullptr;             ///< and back
  JacobianVjpLanes<Real> lanes;    ///< results of lanes
  JacobianLanesArgs<Real> args{};  ///< and their arguments
  Offset teams = 0;                ///< of such lanes
};

/// Differentiates contact batches on a device: one launch, in memory that is taken when it is made. For batches of J
/// and M two more come before it, and a third where lanes differentiate environments. Memory for sweeps and relaxed
/// reactions grows with the calls.
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
  void queue_job(const KernelRef& kernel, const Job& job, StreamHandle stream, const std::uint8_t* written = nullptr);
  template <class Program, class Job, class Contact>
  void queue_contacts(const KernelRef& kernel, const Contact& contact, StreamHandle stream);
  template <class Program, class Real, class Job>
  void queue_jacobians(JacobianRoom<Real>& room, const KernelRef& kernel, Job job, StreamHandle stream);
  template <class Real>
  void queue_sweeps(const KernelRef& kernel, const UnrolledJob<Real>& job, StreamHandle stream);
  [[nodiscard]] const DerivativePair& kernels(Precision precision) const;
  [[nodiscard]] const KernelRef& unrolled_kernel(Precision precision) const;
  [[nodiscard]] const KernelRef& lanes_kernel(Precision precision) const;
  [[nodiscard]] Offset teams_for(Offset slot) const;
  template <class Real, class Job>
  void queue_lanes(const JacobianRoom<Real>& room, Job& job, StreamHandle stream);
  template <class Real>
  void make_room(JacobianRoom<Real>& room, const JacobianBatchView<Real>& batch, Offset count, StreamHandle stream);
  template <class Real>
  void add_lanes(JacobianRoom<Real>& room, const JacobianNumbers& numbers, ArraySet& set) const;
  void make_room(DeviceMemory& memory, Offset doubles, StreamHandle stream);

  std::shared_ptr<DeviceApi> api_;
  bool eager_;
  bool captured_ = false;  ///< graphs hold the present memory
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
