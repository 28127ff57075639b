#pragma once

#include <memory>
#include <vector>

#include "core/schedule/plan.hpp"
#include "stiction/solver.hpp"

namespace stiction {

/// One solve, as a machine receives it: everything checked, nothing decided any more.
template <class Real>
struct SolveRequest {
  const PlanData& plan;
  ContactBatchView<Real> batch;
  SolutionView<Real> solution;
  const Real* warm_start;
  Law law;
  SolverOptions options;
  StreamRef stream;
};

/// A machine. There are two, reached through the factories below; neither holds arithmetic.
class Backend {
 public:
  virtual ~Backend() = default;
  virtual void solve(const SolveRequest<float>& request) = 0;
  virtual void solve(const SolveRequest<double>& request) = 0;
  /// A host copy of `bytes` bytes at `source` in this machine's memory, ordered after the work on `stream`.
  virtual void copy_to_host(void* target, const void* source, std::size_t bytes, StreamRef stream) = 0;
};

std::unique_ptr<Backend> make_cpu_backend();
/// \throws Error(no_device) with the reason, Error(unsupported) in a build without CUDA.
std::unique_ptr<Backend> make_cuda_backend(int ordinal);

/// One line about the CPU; one per CUDA device, or one with the reason why there is none. Never throw.
DeviceReport cpu_report();
std::vector<DeviceReport> cuda_reports();

}  // namespace stiction
