#include <cooperative_groups.h>
#include <cuda_runtime.h>

#include <algorithm>
#include <vector>

#include "cuda/native/cuda_check.hpp"
#include "tools/gpu_first/target.hpp"

/// Assumptions of the kernels' design about the hardware. A chain of one operation by one warp shows its latency,
/// which nothing hides.
namespace stiction::gpu_first {

namespace {

constexpr int kSteps = 512;      // links of a chain
constexpr int kWords = 1024;     // of shared memory, a ring of indices
constexpr int kLocalWords = 64;  // of a lane's stack
constexpr int kWarp = 32;
constexpr int kBlock = 256;      // threads of the block that meets at barriers
constexpr int kNodes = 100;      // launches in a graph
constexpr int kLaunches = 2000;  // launches one after the other
constexpr std::size_t kBytes = std::size_t{256} << 20;

struct Clocks {
  long long taken;
  int sink;  ///< keeps the compiler from leaving the chain out
};

/// Clocks of `step`, repeated; each step depends on `x`.
template <class Step>
__device__ void measure(Clocks* out, int x, Step&& step) {
  x = step(x);
  const long long begin = clock64();
#pragma unroll 16
  for (int i = 0; i < kSteps; ++i) x = step(x);
  const long long end = clock64();
  if (threadIdx.x == 0) *out = {end - begin, x};
}

__device__ void fill_ring(int* ring) {
  for (int i = static_cast<int>(threadIdx.x); i < kWords; i += static_cast<int>(blockDim.x))
    ring[i] = (i + 37) % kWords;
  __syncthreads();
}

__global__ void shared_chain(Clocks* out) {
  __shared__ int ring[kWords];
  fill_ring(ring);
  measure(out, static_cast<int>(threadIdx.x), [&](int x) { return ring[x]; });
}
/// Addresses of shared memory through a pointer of which the compiler cannot know where it leads.
__global__ void generic_chain(Clocks* out, int* global, int use_global) {
  __shared__ int ring[kWords];
  fill_ring(ring);
  int* const any = use_global != 0 ? global : ring;
  measure(out, static_cast<int>(threadIdx.x), [&](int x) { return any[x]; });
}
__global__ void global_chain(Clocks* out, const int* ring) {
  measure(out, static_cast<int>(threadIdx.x), [&](int x) { return __ldcg(ring + x); });
}
__global__ void local_chain(Clocks* out, int stride) {
  int ring[kLocalWords];
  for (int i = 0; i < kLocalWords; ++i) ring[i] = (i + stride) % kLocalWords;
  measure(out, static_cast<int>(threadIdx.x), [&](int x) { return ring[x]; });
}
/// The mask is a number of each lane, as in CudaTeam: one that is alike for all lanes costs nothing.
__global__ void warp_barrier(Clocks* out, const unsigned* masks) {
  unsigned mask = masks[threadIdx.x];
  measure(out, 1, [&](int x) {
    asm volatile("" : "+r"(mask));  // as if it had been loaded again
    __syncwarp(mask);
    return x + 1;
  });
}
__global__ void whole_warp_barrier(Clocks* out) {
  measure(out, 1, [&](int x) {
    __syncwarp();
    return x + 1;
  });
}
__global__ void shuffle_chain(Clocks* out, unsigned mask) {
  measure(out, static_cast<int>(threadIdx.x), [&](int x) { return __shfl_xor_sync(mask, x, 1) + 1; });
}
__global__ void reduce_chain(Clocks* out, unsigned mask) {
  measure(out, static_cast<int>(threadIdx.x),
          [&](int x) { return static_cast<int>(__reduce_add_sync(mask, static_cast<unsigned>(x))) + 1; });
}
__global__ void match_chain(Clocks* out, unsigned mask) {
  measure(out, 1, [&](int x) { return static_cast<int>(__match_any_sync(mask, x)) + 1; });
}
__global__ void block_barrier(Clocks* out) {
  measure(out, 1, [&](int x) {
    __syncthreads();
    return x + 1;
  });
}
__global__ void fused_chain(Clocks* out, float a, float b) {
  measure(out, 1, [&](int x) { return __float_as_int(__fmaf_rn(__int_as_float(x), a, b)); });
}
__global__ void quotient_chain(Clocks* out, float a) {
  measure(out, 0x3f800000, [&](int x) { return __float_as_int(__fdiv_rn(a, __int_as_float(x))); });
}
__global__ void root_chain(Clocks* out, float a) {
  measure(out, 0x3f800000, [&](int x) { return __float_as_int(__fsqrt_rn(__int_as_float(x) + a)); });
}
__global__ void grid_barrier(Clocks* out) {
  const auto grid = cooperative_groups::this_grid();
  grid.sync();
  const long long begin = clock64();
  for (int i = 0; i < kNodes; ++i) grid.sync();
  if (grid.thread_rank() == 0) *out = {clock64() - begin, 0};
}
__global__ void nothing() {}

class Bench {
 public:
  using Reporter = std::function<void(const std::string& name, double value, const std::string& unit)>;
  explicit Bench(const Reporter& report) : report_(report) {
    STICTION_CUDA_TRY(cudaMalloc(&clocks_, sizeof(Clocks)));
    STICTION_CUDA_TRY(cudaMalloc(&ring_, kWords * sizeof(int)));
    std::vector<int> ring(kWords);
    for (int i = 0; i < kWords; ++i) ring[static_cast<std::size_t>(i)] = (i + 37) % kWords;
    STICTION_CUDA_TRY(cudaMemcpy(ring_, ring.data(), kWords * sizeof(int), cudaMemcpyHostToDevice));
    std::vector<unsigned> masks(2 * kWarp, 0xffffffffU);
    for (int lane = 0; lane < kWarp; ++lane) masks[static_cast<std::size_t>(kWarp + lane)] = 0xffU << lane / 8 * 8;
    STICTION_CUDA_TRY(cudaMalloc(&masks_, masks.size() * sizeof(unsigned)));
    STICTION_CUDA_TRY(cudaMemcpy(masks_, masks.data(), masks.size() * sizeof(unsigned), cudaMemcpyHostToDevice));
    STICTION_CUDA_TRY(cudaStreamCreateWithFlags(&stream_, cudaStreamNonBlocking));
    STICTION_CUDA_TRY(cudaEventCreate(&from_));
    STICTION_CUDA_TRY(cudaEventCreate(&to_));
  }
  ~Bench() {
    cudaFree(clocks_);
    cudaFree(ring_);
    cudaFree(masks_);
    cudaStreamDestroy(stream_);
    cudaEventDestroy(from_);
    cudaEventDestroy(to_);
  }
  Bench(const Bench&) = delete;
  Bench& operator=(const Bench&) = delete;

  void latencies() {
    const auto one = [&](const char* name, int threads, auto kernel, auto... arguments) {
      chain(name, kSteps, 1, threads, kernel, arguments...);
    };
    one("shared load", 32, shared_chain);
    one("generic load of shared memory", 32, generic_chain, ring_, 0);
    one("global load, L2", 32, global_chain, static_cast<const int*>(ring_));
    one("local load", 32, local_chain, 7);
    one("warp barrier, mask at run time", 32, warp_barrier, static_cast<const unsigned*>(masks_));
    one("warp barrier, four groups of 8 lanes", 32, warp_barrier, static_cast<const unsigned*>(masks_ + kWarp));
    one("warp barrier, whole warp", 32, whole_warp_barrier);
    one("shuffle", 32, shuffle_chain, 0xffffffffU);
    one("reduction over a warp", 32, reduce_chain, 0xffffffffU);
    one("match in a warp", 32, match_chain, 0xffffffffU);
    one("block barrier, 256 threads", kBlock, block_barrier);
    one("fused multiply-add", 32, fused_chain, 0.5F, 1.0F);
    one("quotient, rounded", 32, quotient_chain, 1.5F);
    one("root, rounded", 32, root_chain, 0.25F);
    grid();
  }

  void launches() {
    STICTION_CUDA_TRY(cudaStreamSynchronize(stream_));
    report_("launch", timed([&] {
                        for (int i = 0; i < kLaunches; ++i) nothing<<<1, 32, 0, stream_>>>();
                      }) / kLaunches,
            "us");
    cudaGraph_t graph = nullptr;
    cudaGraphExec_t ready = nullptr;
    STICTION_CUDA_TRY(cudaStreamBeginCapture(stream_, cudaStreamCaptureModeThreadLocal));
    for (int i = 0; i < kNodes; ++i) nothing<<<1, 32, 0, stream_>>>();
    STICTION_CUDA_TRY(cudaStreamEndCapture(stream_, &graph));
    STICTION_CUDA_TRY(cudaGraphInstantiate(&ready, graph, 0));
    const auto whole = [&] { return timed([&] { cudaGraphLaunch(ready, stream_); }); };
    whole();
    report_("node of a graph", whole() / kNodes, "us");
    cudaGraphExecDestroy(ready);
    cudaGraphDestroy(graph);
  }

  void bandwidths() {
    void *there = nullptr, *beside = nullptr, *here = nullptr;
    STICTION_CUDA_TRY(cudaMalloc(&there, kBytes));
    STICTION_CUDA_TRY(cudaMalloc(&beside, kBytes));
    STICTION_CUDA_TRY(cudaMallocHost(&here, kBytes));
    const auto copy = [&](const char* name, void* to, const void* from, cudaMemcpyKind kind, double factor) {
      const auto once = [&] { return timed([&] { cudaMemcpyAsync(to, from, kBytes, kind, stream_); }); };
      once();
      report_(name, factor * static_cast<double>(kBytes) / (1e3 * once()), "GB/s");
    };
    copy("copy to the device", there, here, cudaMemcpyHostToDevice, 1);
    copy("copy to the host", here, there, cudaMemcpyDeviceToHost, 1);
    copy("copy on the device, read and written", beside, there, cudaMemcpyDeviceToDevice, 2);
    cudaFree(there);
    cudaFree(beside);
    cudaFreeHost(here);
  }

 private:
  /// Microseconds of the work that `queue` queues.
  template <class F>
  double timed(F&& queue) {
    STICTION_CUDA_TRY(cudaEventRecord(from_, stream_));
    queue();
    STICTION_CUDA_TRY(cudaEventRecord(to_, stream_));
    STICTION_CUDA_TRY(cudaStreamSynchronize(stream_));
    STICTION_CUDA_TRY(cudaGetLastError());
    float milliseconds = 0;
    STICTION_CUDA_TRY(cudaEventElapsedTime(&milliseconds, from_, to_));
    return 1e3 * static_cast<double>(milliseconds);
  }

  /// The least clocks of a step in three runs.
  template <class Kernel, class... Arguments>
  void chain(const char* name, int steps, int blocks, int threads, Kernel kernel, Arguments... arguments) {
    long long least = 0;
    for (int run = 0; run < 3; ++run) {
      kernel<<<blocks, threads, 0, stream_>>>(clocks_, arguments...);
      STICTION_CUDA_TRY(cudaGetLastError());
      const long long taken = read_clocks();
      if (run == 0 || taken < least) least = taken;
    }
    report_(name, static_cast<double>(least) / steps, "clocks");
  }
  long long read_clocks() {
    Clocks clocks{};
    STICTION_CUDA_TRY(cudaMemcpyAsync(&clocks, clocks_, sizeof clocks, cudaMemcpyDeviceToHost, stream_));
    STICTION_CUDA_TRY(cudaStreamSynchronize(stream_));
    return clocks.taken;
  }

  void grid() {
    int device = 0, processors = 0;
    STICTION_CUDA_TRY(cudaGetDevice(&device));
    STICTION_CUDA_TRY(cudaDeviceGetAttribute(&processors, cudaDevAttrMultiProcessorCount, device));
    for (const int each : {1, 2}) {
      void* arguments[] = {&clocks_};
      const double us = timed([&] {
        STICTION_CUDA_TRY(cudaLaunchCooperativeKernel(reinterpret_cast<const void*>(&grid_barrier),
                                                      dim3(static_cast<unsigned>(each * processors)), dim3(kBlock),
                                                      arguments, 0, stream_));
      });
      const std::string blocks = std::to_string(each * processors) + " blocks";
      report_("grid barrier, " + blocks, static_cast<double>(read_clocks()) / kNodes, "clocks");
      report_("grid barrier, " + blocks + ", launch included", us / kNodes, "us");
    }
  }

  const Reporter& report_;
  Clocks* clocks_ = nullptr;
  int* ring_ = nullptr;
  unsigned* masks_ = nullptr;  ///< of the lanes of a warp: all lanes, then groups of eight
  cudaStream_t stream_ = nullptr;
  cudaEvent_t from_ = nullptr, to_ = nullptr;
};

}  // namespace

void measure_basics(const std::function<void(const std::string&, double, const std::string&)>& report) {
  Bench bench(report);
  bench.latencies();
  bench.launches();
  bench.bandwidths();
}

}  // namespace stiction::gpu_first
