#include <cstdlib>
#include <memory>
#include <mutex>
#include <string>

#include "core/runtime/backend.hpp"
#include "cuda/cuda_device.hpp"
#include "cuda/cuda_memory.hpp"
#include "cuda/cuda_stream.hpp"
#include "cuda/job.hpp"
#include "cuda/plan_cache.hpp"
#include "cuda/transfer.hpp"
#include "stiction/error.hpp"

namespace stiction {

namespace cuda {

namespace {

KernelSet choose_kernels(SolverKind solver) {
  switch (solver) {
    case SolverKind::pgs:
      return pgs_kernels();
    case SolverKind::npgs:
      return npgs_kernels();
    case SolverKind::jacobi:
      return jacobi_kernels();
    case SolverKind::apgd:
      return apgd_kernels();
  }
  throw Error(ErrorCode::invalid_argument, "solver " + std::to_string(static_cast<int>(solver)) + " is not known");
}

void launch_solve(const KernelSet& kernels, const Job<float>& job, const LaunchSpan& span, cudaStream_t stream) {
  kernels.f32(job, span.team, span.width, stream);
}
void launch_solve(const KernelSet& kernels, const Job<double>& job, const LaunchSpan& span, cudaStream_t stream) {
  kernels.f64(job, span.team, span.width, stream);
}

/// The rules, with the most rows a thread takes from the environment variable STICTION_CUDA_THREAD_ROWS if it is set:
/// for measuring, and for tests that a team changes no bit.
LayoutRules layout_rules(Offset method_vectors) {
  LayoutRules rules{method_vectors};
  if (const char* rows = std::getenv("STICTION_CUDA_THREAD_ROWS")) rules.thread_rows = std::atoi(rows);
  return rules;
}

/// A host batch's arrays, warm start and solution in device memory for one solve.
template <class Real>
class DeviceBatch {
 public:
  DeviceBatch(const SolveRequest<Real>& request, MemoryPool& pool, cudaStream_t stream)
      : batch(request.batch), warm_start(request.warm_start), solution(request.solution) {
    const ContactBatchView<Real>& host = request.batch;
    ArraySet arrays;
    arrays.add(batch.env_row_offsets, host.env_row_offsets, host.env_count + 1);
    arrays.add(batch.env_cone_offsets, host.env_cone_offsets, host.env_count + 1);
    arrays.add(batch.cone_kind, host.cone_kind, host.cone_count);
    arrays.add(batch.cone_row_offsets, host.cone_row_offsets, host.cone_count + 1);
    arrays.add(batch.row_offsets, host.row_offsets, host.row_count + 1);
    arrays.add(batch.column, host.column, host.nonzero_count);
    arrays.add(batch.A, host.A, host.nonzero_count);
    for (const Real* ContactBatchView<Real>::*rows :
         {&ContactBatchView<Real>::b, &ContactBatchView<Real>::R, &ContactBatchView<Real>::mu,
          &ContactBatchView<Real>::lo, &ContactBatchView<Real>::hi})
      arrays.add(batch.*rows, host.*rows, host.row_count);
    if (warm_start != nullptr) arrays.add(warm_start, request.warm_start, host.row_count);
    arrays.add(solution.lambda, host.row_count);
    if (solution.w != nullptr) arrays.add(solution.w, host.row_count);
    arrays.add(solution.status, host.env_count);
    memory_ = arrays.allocate(pool, stream);
  }

  /// The solution back on the host, once the stream has come this far.
  void download(const SolutionView<Real>& host, cudaStream_t stream) const {
    const auto fetch = [stream](auto* target, const auto* source, Offset count) {
      if (target != nullptr && count > 0)
        STICTION_CUDA_TRY(cudaMemcpyAsync(target, source, static_cast<std::size_t>(count) * sizeof(*target),
                                          cudaMemcpyDeviceToHost, stream));
    };
    fetch(host.lambda, solution.lambda, batch.row_count);
    fetch(host.w, solution.w, batch.row_count);
    fetch(host.status, solution.status, batch.env_count);
  }

  ContactBatchView<Real> batch;
  const Real* warm_start;
  SolutionView<Real> solution;

 private:
  DeviceBuffer memory_;
};

/// The CUDA machine. Solves may be asked for from several threads; they are queued one after the other.
class CudaBackend final : public Backend {
 public:
  explicit CudaBackend(int ordinal) : ordinal_(ordinal) {
    const DeviceGuard device(ordinal_);
    resources_ = std::make_unique<Resources>(ordinal_);
  }
  void solve(const SolveRequest<float>& request) override { run(request); }
  void solve(const SolveRequest<double>& request) override { run(request); }

  void copy_to_host(void* target, const void* source, std::size_t bytes, StreamRef stream) override {
    const DeviceGuard device(ordinal_);
    const auto handle = static_cast<cudaStream_t>(stream.handle());
    STICTION_CUDA_TRY(cudaMemcpyAsync(target, source, bytes, cudaMemcpyDeviceToHost, handle));
    STICTION_CUDA_TRY(cudaStreamSynchronize(handle));
  }

 private:
  /// Made while the device is current.
  struct Resources {
    explicit Resources(int ordinal) : pool(ordinal) {}
    MemoryPool pool;
    Stream stream;
    std::unique_ptr<PlanCache> plans;
  };

  template <class Real>
  void run(const SolveRequest<Real>& request) {
    if (request.batch.env_count == 0) return;
    const std::lock_guard lock(mutex_);
    const DeviceGuard device(ordinal_);
    const KernelSet kernels = choose_kernels(request.options.solver);
    if (!resources_->plans)
      resources_->plans = std::make_unique<PlanCache>(resources_->pool, layout_rules(kernels.method_vectors));
    const auto asked = static_cast<cudaStream_t>(request.stream.handle());

    if (request.batch.space == MemorySpace::cuda) {
      queue(kernels, request, request.batch, request.warm_start, request.solution, asked);
      return;
    }
    const cudaStream_t stream = asked == nullptr ? resources_->stream.get() : asked;
    const DeviceBatch<Real> copy(request, resources_->pool, stream);
    queue(kernels, request, copy.batch, copy.warm_start, copy.solution, stream);
    copy.download(request.solution, stream);
    STICTION_CUDA_TRY(cudaStreamSynchronize(stream));
  }

  /// Queues the kernels on device memory; returns at once.
  template <class Real>
  void queue(const KernelSet& kernels, const SolveRequest<Real>& request, const ContactBatchView<Real>& batch,
             const Real* warm_start, const SolutionView<Real>& solution, cudaStream_t stream) {
    const DevicePlan& plan = resources_->plans->get(request.plan, stream);
    const DeviceBuffer workspace(resources_->pool, static_cast<std::size_t>(plan.layout.workspace) * sizeof(Real),
                                 stream);
    const SolverOptions& options = request.options;
    Job<Real> job{batch,
                  plan.view,
                  warm_start,
                  solution.lambda,
                  solution.w,
                  solution.status,
                  options.tolerance,
                  options.max_iterations,
                  options.stall_window,
                  static_cast<Real>(options.omega),
                  request.law,
                  nullptr,
                  nullptr,
                  0,
                  reinterpret_cast<Real*>(workspace.get())};
    for (const LaunchSpan& span : plan.layout.launches) {
      job.envs = plan.envs + span.first_env;
      job.offsets = plan.offsets + span.first_offset;
      job.count = span.env_count;
      launch_load(job, kernels, span.team, span.width, stream);
      launch_solve(kernels, job, span, stream);
    }
    resources_->plans->used_on(stream);
  }

  int ordinal_;
  std::mutex mutex_;
  std::unique_ptr<Resources> resources_;
};

}  // namespace

}  // namespace cuda

std::unique_ptr<Backend> make_cuda_backend(int ordinal) {
  std::string reason;
  const int count = cuda::device_count(reason);
  if (count > 0) reason = cuda::why_unusable(ordinal, count);
  if (!reason.empty()) throw Error(ErrorCode::no_device, reason + "; solve on the cpu");
  return std::make_unique<cuda::CudaBackend>(ordinal);
}

}  // namespace stiction
