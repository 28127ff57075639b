#include <gtest/gtest.h>

#include "tests/support/machines/cuda_device.hpp"

/// A solve captured into a CUDA graph once and launched again and again.
#if !defined(STICTION_HAS_CUDA)
TEST(CudaGraph, IsTestedWhereTheBuildHasCuda) {
  GTEST_SKIP() << "built without the CUDA machine";
}
#else

#include <cuda_runtime_api.h>

#include <vector>

#include "cuda/native/cuda_api.hpp"
#include "cuda/native/cuda_check.hpp"
#include "tests/support/machines/device_batch.hpp"
#include "tests/support/systems/twin_batches.hpp"

namespace stiction::test {
namespace {

/// Owner of a graph that can be launched.
class Graph {
 public:
  /// Captures the work that `queue` queues on the stream.
  template <class F>
  Graph(cudaStream_t stream, F&& queue) : stream_(stream) {
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

  void launch() { STICTION_CUDA_TRY(cudaGraphLaunch(graph_, stream_)); }

 private:
  cudaStream_t stream_;
  cudaGraphExec_t graph_ = nullptr;
};

TEST(CudaGraph, ACapturedSolveIsReplayedWithOtherNumbersContactsAndCounts) {
  std::string reason;
  const std::optional<Device> device = usable_cuda(reason);
  if (!device) GTEST_SKIP() << "no GPU to replay a graph on: " << reason;
  STICTION_CUDA_TRY(cudaSetDevice(device->ordinal));

  const std::vector<ContactBatch<float> > batches = different_batches(12, 64);
  Capacity room;
  for (const ContactBatch<float>& batch : batches) room = larger(room, Capacity::of(batch.view()));
  for (const SolverKind kind : {SolverKind::pgs, SolverKind::npgs, SolverKind::jacobi, SolverKind::apgd}) {
    SCOPED_TRACE(to_string(kind));
    SolverOptions options;
    options.solver = kind;
    options.max_iterations = 24;
    options.law = Law::coulomb;  // captured work has a law before it has a batch
    options.invalid = InvalidPolicy::isolate;
    const Solver solver(*device, options, room);
    cuda::CudaApi api(device->ordinal);
    const cuda::Stream stream(api);
    DeviceBatch<float> there(api, room);
    Graph graph(static_cast<cudaStream_t>(stream.get()), [&] {
      solver.solve(there.view(), there.solution(), static_cast<const float*>(nullptr), StreamRef(stream.get()));
    });
    for (std::size_t i = 0; i < batches.size(); ++i) {
      there.fill(batches[i], stream.get());
      graph.launch();
      EXPECT_EQ(env_hashes(batches[i], there.fetch(batches[i], stream.get())), solve_hashes(batches[i], options)) << i;
    }
  }
}

}  // namespace
}  // namespace stiction::test

#endif
