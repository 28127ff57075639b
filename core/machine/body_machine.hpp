#pragma once

#include <functional>
#include <memory>

#include "core/job/parallel_for.hpp"
#include "core/plan/body_plan.hpp"

namespace stiction {

/// One body solve, as a machine receives it: everything checked.
template <class Real>
struct BodyRequest {
  std::shared_ptr<const BodyPlanData> plan;
  BodyBatchView<Real> batch;
  BodySolutionView<Real> solution;
  const Real* warm_start;
  TimeStepping stepping;
  BodySolverOptions options;
  StreamRef stream;
};

/// A machine that solves bodies. None holds arithmetic.
class BodyMachine {
 public:
  virtual ~BodyMachine() = default;
  virtual void solve(const BodyRequest<float>& request) = 0;
  virtual void solve(const BodyRequest<double>& request) = 0;
  /// Shares work on a batch on the host among the threads that a solve may use.
  virtual void parallel_for(int /*threads*/, Offset count, const std::function<void(Offset, Offset)>& work) {
    all_at_once(count, work);
  }
  /// A host copy of `bytes` bytes at `source` in this machine's memory, ordered after the work on `stream`.
  virtual void copy_to_host(void* target, const void* source, std::size_t bytes, StreamRef stream) = 0;
};

std::unique_ptr<BodyMachine> make_cpu_body_machine();
std::unique_ptr<BodyMachine> make_emulated_body_machine();
/// \throws Error(no_device) with the reason, Error(unsupported) in a build without CUDA.
std::unique_ptr<BodyMachine> make_cuda_body_machine(int ordinal);

/// The structural defects alone: the first of validate()'s list. Only the integers are read.
template <class Real>
std::vector<Defect> validate_structure(const BodyBatchView<Real>& batch, std::size_t limit,
                                       const ParallelFor& parallel_for);
/// validate() by several threads.
template <class Real>
std::vector<Defect> validate(const BodyBatchView<Real>& batch, std::size_t limit, const ParallelFor& parallel_for);

}  // namespace stiction
