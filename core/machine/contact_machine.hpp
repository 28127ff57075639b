#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "core/base/dense_rows.hpp"
#include "core/job/parallel_for.hpp"
#include "core/plan/plan.hpp"
#include "stiction/solver.hpp"

namespace stiction {

/// One solve, as a machine receives it: everything checked, nothing decided any more.
template <class Real>
struct SolveRequest {
  const PlanData* plan;  ///< null: the machine plans by itself (the CPU always has one)
  ContactBatchView<Real> batch;
  SolutionView<Real> solution;
  const Real* warm_start;
  Law law;
  SolverOptions options;
  StreamRef stream;
  const std::vector<FullRows>* full_rows =
      nullptr;  ///< of each environment of a batch on the host, or null: not looked at
};

/// A machine. There are three, reached through the factories below; none holds arithmetic.
class ContactMachine {
 public:
  virtual ~ContactMachine() = default;
  virtual void solve(const SolveRequest<float>& request) = 0;
  virtual void solve(const SolveRequest<double>& request) = 0;
  /// Makes room for solves, where a machine has room of its own. \throws Error(out_of_memory).
  virtual void reserve(const Capacity&, SolverKind) {}
  /// Shares work on a batch on the host among the threads that a solve may use.
  virtual void parallel_for(int /*threads*/, Offset count, const std::function<void(Offset, Offset)>& work) {
    all_at_once(count, work);
  }
  /// Finds the islands of a batch in this machine's memory; only its integers are looked at.
  virtual void islands(const BatchStructure&, Index*, Index*, StreamRef) {}
  /// Memory of this machine. \throws Error(out_of_memory).
  virtual void* allocate(std::size_t bytes) = 0;
  virtual void release(void* memory) noexcept = 0;
  /// Returns when the work on `stream` is done. \throws its error.
  virtual void synchronize(StreamRef) {}
  /// A host copy of `bytes` bytes at `source` in this machine's memory, ordered after the work on `stream`.
  virtual void copy_to_host(void* target, const void* source, std::size_t bytes, StreamRef stream) = 0;
};

std::unique_ptr<ContactMachine> make_cpu_contact_machine();
/// \throws Error(no_device) with the reason, Error(unsupported) in a build without CUDA.
std::unique_ptr<ContactMachine> make_cuda_contact_machine(int ordinal);
std::unique_ptr<ContactMachine> make_emulated_contact_machine();

/// One line about the CPU; one per CUDA device, or one with the reason why there is none. Never throw.
DeviceReport cpu_report();
DeviceReport emulated_report();
std::vector<DeviceReport> cuda_reports();

}  // namespace stiction
