#include "tools/gpu_first/target.hpp"

#if !defined(STICTION_HAS_CUDA)

namespace stiction::gpu_first {

std::unique_ptr<Target> make_cuda_target(int) {
  return nullptr;
}
void measure_basics(const std::function<void(const std::string&, double, const std::string&)>&) {}

}  // namespace stiction::gpu_first

#else

#include <cuda_runtime_api.h>

#include "cuda/native/cuda_api.hpp"
#include "cuda/native/cuda_check.hpp"
#include "cuda/native/cuda_device.hpp"
#include "cuda/native/cuda_kernel.hpp"
#include "stiction/error.hpp"

namespace stiction::gpu_first {

namespace {

/// Owner of a graph that can be launched.
class Graph {
 public:
  Graph(cudaStream_t stream, const std::function<void()>& queue) {
    STICTION_CUDA_TRY(cudaStreamBeginCapture(stream, cudaStreamCaptureModeThreadLocal));
    queue();
    cudaGraph_t graph = nullptr;
    STICTION_CUDA_TRY(cudaStreamEndCapture(stream, &graph));
    const cudaError_t result = cudaGraphInstantiate(&graph_, graph, 0);
    cudaGraphDestroy(graph);
    STICTION_CUDA_TRY(result);
  }
  ~Graph() {
    if (graph_ != nullptr) cudaGraphExecDestroy(graph_);
  }
  Graph(const Graph&) = delete;
  Graph& operator=(const Graph&) = delete;
  void launch(cudaStream_t stream) const { STICTION_CUDA_TRY(cudaGraphLaunch(graph_, stream)); }

 private:
  cudaGraphExec_t graph_ = nullptr;
};

class CudaTarget final : public Target {
 public:
  explicit CudaTarget(int ordinal) : ordinal_(ordinal), api_(std::make_shared<cuda::CudaApi>(ordinal)) {
    STICTION_CUDA_TRY(cudaSetDevice(ordinal));
  }

  [[nodiscard]] Device device() const override { return Device::cuda(ordinal_); }
  [[nodiscard]] std::shared_ptr<cuda::DeviceApi> api() const override { return api_; }
  [[nodiscard]] bool is_native() const override { return true; }
  [[nodiscard]] bool carries(const cuda::KernelRef& kernel) const override {
    return kernel.entry != nullptr && static_cast<const cuda::CudaKernel*>(kernel.entry)->function != nullptr;
  }
  void describe(JsonLine& line) const override {
    cudaDeviceProp facts{};
    STICTION_CUDA_TRY(cudaGetDeviceProperties(&facts, ordinal_));
    int driver = 0, runtime = 0, clock = 0, memory_clock = 0;
    STICTION_CUDA_TRY(cudaDriverGetVersion(&driver));
    STICTION_CUDA_TRY(cudaRuntimeGetVersion(&runtime));
    STICTION_CUDA_TRY(cudaDeviceGetAttribute(&clock, cudaDevAttrClockRate, ordinal_));
    STICTION_CUDA_TRY(cudaDeviceGetAttribute(&memory_clock, cudaDevAttrMemoryClockRate, ordinal_));
    line.add("name", facts.name).add("capability", 10 * facts.major + facts.minor).add("driver", driver);
    line.add("runtime", runtime).add("processors", facts.multiProcessorCount);
    line.add("shared_bytes_of_a_block", facts.sharedMemPerBlockOptin);
    line.add("shared_bytes_of_a_processor", facts.sharedMemPerMultiprocessor);
    line.add("registers_of_a_processor", facts.regsPerMultiprocessor).add("memory_bytes", facts.totalGlobalMem);
    line.add("l2_bytes", facts.l2CacheSize).add("memory_bus_bits", facts.memoryBusWidth);
    line.add("clock_khz", clock).add("memory_clock_khz", memory_clock).add("ecc", facts.ECCEnabled);
    line.add("cooperative_launch", facts.cooperativeLaunch);
  }
  std::function<void()> capture(cuda::StreamHandle stream, const std::function<void()>& queue) override {
    const auto native = static_cast<cudaStream_t>(stream);
    return [native, graph = std::make_shared<const Graph>(native, queue)] { graph->launch(native); };
  }

 private:
  int ordinal_;
  std::shared_ptr<cuda::CudaApi> api_;
};

}  // namespace

std::unique_ptr<Target> make_cuda_target(int ordinal) {
  std::string reason;
  const int count = cuda::device_count(reason);
  if (count > 0) reason = cuda::why_unusable(ordinal, count);
  if (!reason.empty()) throw Error(ErrorCode::no_device, reason + "; rehearse with --device emulated");
  return std::make_unique<CudaTarget>(ordinal);
}

}  // namespace stiction::gpu_first

#endif
