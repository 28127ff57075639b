#include "cuda/native/cuda_condition.hpp"

#include <cuda_runtime.h>

#include "cuda/native/cuda_check.hpp"
#include "stiction/error.hpp"

namespace stiction::cuda {

// Drivers of CUDA 12.3 to 12.5 know conditional nodes, but take no cooperative launch in them.
#if CUDART_VERSION >= 13000

namespace {

__global__ void set_condition(cudaGraphConditionalHandle handle, const Offset* value) {
  cudaGraphSetConditional(handle, *value != 0 ? 1U : 0U);
}

/// The work that is captured on a stream so far.
struct Capture {
  cudaGraph_t graph = nullptr;
  const cudaGraphNode_t* last = nullptr;  ///< dependency of the next node
  const cudaGraphEdgeData* edges = nullptr;
  std::size_t count = 0;

  explicit Capture(cudaStream_t stream) {
    cudaStreamCaptureStatus status = cudaStreamCaptureStatusNone;
    STICTION_CUDA_TRY(cudaStreamGetCaptureInfo(stream, &status, nullptr, &graph, &last, &edges, &count));
  }
};

/// Adds a condition to the graph captured on `stream`. Returns the graph that it is for.
cudaGraph_t add_condition(const Offset* condition, cudaStream_t stream) {
  cudaGraphConditionalHandle handle{};
  STICTION_CUDA_TRY(cudaGraphConditionalHandleCreate(&handle, Capture(stream).graph, 1, cudaGraphCondAssignDefault));
  void* arguments[] = {&handle, &condition};
  STICTION_CUDA_TRY(
      cudaLaunchKernel(reinterpret_cast<const void*>(&set_condition), dim3(1), dim3(1), arguments, 0, stream));
  cudaGraphNodeParams node{};
  node.type = cudaGraphNodeTypeConditional;
  node.conditional.handle = handle;
  node.conditional.type = cudaGraphCondTypeIf;
  node.conditional.size = 1;
  cudaGraphNode_t added = nullptr;
  const Capture before(stream);
  STICTION_CUDA_TRY(cudaGraphAddNode(&added, before.graph, before.last, before.edges, before.count, &node));
  STICTION_CUDA_TRY(cudaStreamUpdateCaptureDependencies(stream, &added, nullptr, 1, cudaStreamSetCaptureDependencies));
  return node.conditional.phGraph_out[0];
}

/// Owner of a trial's objects.
struct Trial {
  cudaStream_t stream = nullptr, inner = nullptr;
  Offset* numbers = nullptr;  ///< the condition, and the number written behind it
  cudaGraph_t graph = nullptr;
  cudaGraphExec_t ready = nullptr;

  Trial() = default;
  Trial(const Trial&) = delete;
  Trial& operator=(const Trial&) = delete;
  ~Trial() {
    if (ready != nullptr) cudaGraphExecDestroy(ready);
    if (graph != nullptr) cudaGraphDestroy(graph);
    cudaFree(numbers);
    if (inner != nullptr) cudaStreamDestroy(inner);
    if (stream != nullptr) cudaStreamDestroy(stream);
  }

  void capture() {
    STICTION_CUDA_TRY(cudaStreamCreateWithFlags(&stream, cudaStreamNonBlocking));
    STICTION_CUDA_TRY(cudaStreamCreateWithFlags(&inner, cudaStreamNonBlocking));
    STICTION_CUDA_TRY(cudaMalloc(&numbers, 2 * sizeof(Offset)));
    STICTION_CUDA_TRY(cudaStreamBeginCapture(stream, cudaStreamCaptureModeThreadLocal));
    try {
      capture_conditionally(numbers, stream, inner, [&] {
        STICTION_CUDA_TRY(cudaMemcpyAsync(numbers + 1, numbers, sizeof(Offset), cudaMemcpyDeviceToDevice, inner));
      });
    } catch (const Error&) {
      cudaStreamEndCapture(stream, &graph);
      cudaGetLastError();
      throw;
    }
    STICTION_CUDA_TRY(cudaStreamEndCapture(stream, &graph));
    STICTION_CUDA_TRY(cudaGraphInstantiate(&ready, graph, 0));
  }
  /// Returns true if the body copied the condition, or wrote nothing where that is 0.
  bool is_right(Offset condition) {
    Offset host[2] = {condition, -1};
    STICTION_CUDA_TRY(cudaMemcpyAsync(numbers, host, sizeof host, cudaMemcpyHostToDevice, stream));
    STICTION_CUDA_TRY(cudaGraphLaunch(ready, stream));
    STICTION_CUDA_TRY(cudaMemcpyAsync(host, numbers, sizeof host, cudaMemcpyDeviceToHost, stream));
    STICTION_CUDA_TRY(cudaStreamSynchronize(stream));
    return host[1] == (condition != 0 ? condition : -1);
  }
};

}  // namespace

bool finds_conditions() {
  try {
    Trial trial;
    trial.capture();
    return trial.is_right(0) && trial.is_right(7) && trial.is_right(0);
  } catch (const Error&) {
    return false;
  }
}

void capture_conditionally(const Offset* condition, cudaStream_t stream, cudaStream_t inner,
                           const std::function<void()>& body) {
  cudaGraph_t graph = add_condition(condition, stream);
  STICTION_CUDA_TRY(cudaStreamBeginCaptureToGraph(inner, graph, nullptr, nullptr, 0, cudaStreamCaptureModeThreadLocal));
  try {
    body();
  } catch (...) {
    cudaStreamEndCapture(inner, &graph);
    cudaGetLastError();
    throw;
  }
  STICTION_CUDA_TRY(cudaStreamEndCapture(inner, &graph));
}

#else

bool finds_conditions() {
  return false;
}

void capture_conditionally(const Offset*, cudaStream_t, cudaStream_t, const std::function<void()>&) {}

#endif

}  // namespace stiction::cuda
