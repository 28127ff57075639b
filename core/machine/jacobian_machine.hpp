#pragma once

#include <functional>
#include <memory>

#include "core/job/jacobian_job.hpp"
#include "core/job/velocity_job.hpp"
#include "stiction/jacobian_solver.hpp"

namespace stiction {

/// Operations on a Jacobian batch, every environment of it; all was checked before.
template <class Real>
void assemble_on_cpu(const JacobianJob<Real>& job, int threads);
template <class Real>
void velocities_on_cpu(const JacobianJob<Real>& job, int threads);

/// Everything an assembly or a solve of a host batch indexes by. \throws Error(invalid_argument) at the first fault.
template <class Real>
void check_structure(const JacobianBatchView<Real>& batch);

/// Solves Jacobian batches on one machine, in arrays of its own; everything was checked before. A solve calls
/// solve_velocities() if Newton's method in velocities is asked for, then queue_rest() with assemble() and a contact
/// machine, then write().
template <class Real>
class JacobianMachine {
 public:
  virtual ~JacobianMachine() = default;
  /// Solves environments of a shape that Newton's method in velocities supports, and keeps their answers until write().
  /// Returns true if all are known to be solved: then nothing is assembled.
  virtual bool solve_velocities(const VelocityJob<Real>& job, StreamRef stream) = 0;
  /// Calls `rest`, which assembles and solves environments without an answer, by work that it queues on the stream
  /// that it is given. A device may leave that work out where solve_velocities() has solved all.
  virtual void queue_rest(const JacobianBatchView<Real>&, StreamRef stream,
                          const std::function<void(StreamRef)>& rest) {
    rest(stream);
  }
  /// Returns the contact batch, valid in the order of `stream` until the next call. Environments that
  /// solve_velocities() has solved have no rows in it.
  virtual ContactBatchView<Real> assemble(const JacobianBatchView<Real>& batch, StreamRef stream) = 0;
  /// Layout of assembled environments: each has its place in the machine's arrays, until the next call, and is not
  /// written yet. On the CPU its rows are.
  virtual JacobianBatchJob<Real> lay_out(const JacobianBatchView<Real>& batch, StreamRef stream) = 0;
  /// Writes the answers of solve_velocities(), and for other environments the velocities that `solution.lambda` leads
  /// to.
  virtual void write(const JacobianBatchView<Real>& batch, const JacobianSolutionView<Real>& solution,
                     StreamRef stream) = 0;
};

/// Makes room as it is needed, whatever the capacity.
template <class Real>
std::unique_ptr<JacobianMachine<Real>> make_cpu_jacobian_machine(FactorUse use, int threads);
/// \throws Error(no_device) with the reason, Error(unsupported) in a build without CUDA.
template <class Real>
std::unique_ptr<JacobianMachine<Real>> make_cuda_jacobian_machine(int ordinal, const JacobianCapacity& capacity,
                                                                  FactorUse use, bool by_newton);
template <class Real>
std::unique_ptr<JacobianMachine<Real>> make_emulated_jacobian_machine(const JacobianCapacity& capacity, FactorUse use,
                                                                      bool by_newton);

}  // namespace stiction
