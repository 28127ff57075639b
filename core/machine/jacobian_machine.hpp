#pragma once

#include <memory>

#include "core/job/jacobian_job.hpp"
#include "stiction/jacobian_solver.hpp"

namespace stiction {

/// What can be done to a Jacobian batch, every environment of it; all was checked before.
template <class Real>
void assemble_on_cpu(const JacobianJob<Real>& job, int threads);
template <class Real>
void velocities_on_cpu(const JacobianJob<Real>& job, int threads);

/// Everything an assembly or a solve of a host batch indexes by. \throws Error(invalid_argument) at the first fault.
template <class Real>
void check_structure(const JacobianBatchView<Real>& batch);

/// Makes contact batches of Jacobian batches on one machine, in arrays of its own; everything was checked before.
template <class Real>
class JacobianMachine {
 public:
  virtual ~JacobianMachine() = default;
  /// The contact batch; it is there in the order of `stream`, until the next one.
  virtual ContactBatchView<Real> assemble(const JacobianBatchView<Real>& batch, StreamRef stream) = 0;
  /// The velocities that the answer of that contact batch leads to.
  virtual void velocities(const JacobianBatchView<Real>& batch, const JacobianSolutionView<Real>& solution,
                          StreamRef stream) = 0;
};

/// Makes room as it is needed, whatever a capacity says.
template <class Real>
std::unique_ptr<JacobianMachine<Real>> make_cpu_jacobian(FactorUse use, int threads);
/// \throws Error(no_device) with the reason, Error(unsupported) in a build without CUDA.
template <class Real>
std::unique_ptr<JacobianMachine<Real>> make_cuda_jacobian(int ordinal, const JacobianCapacity& capacity, FactorUse use);
template <class Real>
std::unique_ptr<JacobianMachine<Real>> make_emulated_jacobian(const JacobianCapacity& capacity, FactorUse use);

}  // namespace stiction
