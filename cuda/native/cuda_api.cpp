#include "cuda/native/cuda_api.hpp"

#include <nvtx3/nvToolsExt.h>

#include <algorithm>
#include <cstddef>
#include <vector>

#include "core/base/extents.hpp"
#include "cuda/native/cuda_check.hpp"
#include "cuda/native/cuda_condition.hpp"
#include "cuda/native/cuda_device.hpp"
#include "cuda/native/cuda_kernels.hpp"
#include "cuda/native/cuda_robots.hpp"
#include "cuda/native/launch_grid.hpp"
#include "stiction/error.hpp"

namespace stiction::cuda {

namespace {

cudaStream_t stream_of(StreamHandle stream) {
  return static_cast<cudaStream_t>(stream);
}
cudaEvent_t event_of(EventHandle event) {
  return static_cast<cudaEvent_t>(event);
}

cudaMemcpyKind kind_of(CopyKind kind) {
  switch (kind) {
    case CopyKind::to_device:
      return cudaMemcpyHostToDevice;
    case CopyKind::to_host:
      return cudaMemcpyDeviceToHost;
    case CopyKind::on_device:
      return cudaMemcpyDeviceToDevice;
  }
  return cudaMemcpyDefault;
}

/// Orders launches of a whole device, whichever solver they come from. Two cooperative grids at once may each wait for
/// blocks that the other keeps from running.
class WholeDeviceTurn {
 public:
  /// Waits for the turn before on `stream`, unless that is being captured: a graph's launches are ordered by their
  /// caller.
  WholeDeviceTurn(int ordinal, cudaStream_t stream, bool takes_part)
      : lock_(mutex()), stream_(stream), takes_part_(takes_part) {
    if (!takes_part_) return;
    cudaEvent_t& done = events()[ordinal];
    if (done == nullptr) STICTION_CUDA_TRY(cudaEventCreateWithFlags(&done, cudaEventDisableTiming));
    done_ = done;
    STICTION_CUDA_TRY(cudaStreamWaitEvent(stream_, done_, 0));
  }
  /// The launch is queued.
  void pass_on() {
    if (takes_part_) STICTION_CUDA_TRY(cudaEventRecord(done_, stream_));
  }

 private:
  static std::mutex& mutex() {
    static std::mutex one;
    return one;
  }
  static std::map<int, cudaEvent_t>& events() {
    static auto& all = *new std::map<int, cudaEvent_t>;  // the driver may be gone when the process ends
    return all;
  }

  std::lock_guard<std::mutex> lock_;
  cudaStream_t stream_;
  bool takes_part_;
  cudaEvent_t done_ = nullptr;
};

/// Returns finds_conditions() of the current device, which is asked once.
bool finds_conditions_on(int ordinal) {
  static std::mutex mutex;
  static std::map<int, bool> found;
  const std::lock_guard lock(mutex);
  const auto known = found.find(ordinal);
  if (known != found.end()) return known->second;
  return found[ordinal] = finds_conditions();
}

cudaLaunchAttribute cooperative() {
  cudaLaunchAttribute attribute{};
  attribute.id = cudaLaunchAttributeCooperative;
  attribute.val.cooperative = 1;
  return attribute;
}

}  // namespace

CudaApi::CudaApi(int ordinal) : ordinal_(ordinal) {
  const DeviceGuard device(ordinal_);
  cudaDeviceProp properties{};
  STICTION_CUDA_TRY(cudaGetDeviceProperties(&properties, ordinal));
  facts_ = {properties.name, properties.multiProcessorCount, properties.sharedMemPerBlockOptin,
            properties.sharedMemPerMultiprocessor, properties.totalGlobalMem};
  int shared_with_others = 0;
  STICTION_CUDA_TRY(cudaDeviceGetAttribute(&shared_with_others, cudaDevAttrMpsEnabled, ordinal));
  facts_.is_whole = shared_with_others == 0;
  has_conditions_ = finds_conditions_on(ordinal);
  STICTION_CUDA_TRY(cudaMalloc(&grid_memory_, kGridBytes));
}

CudaApi::~CudaApi() {
  release(grid_memory_);
}

const KernelCatalogue& CudaApi::kernels() const {
  return cuda_kernels();
}
const RobotKernels& CudaApi::robot_kernels() const {
  return cuda_robot_kernels();
}

void* CudaApi::allocate(std::size_t bytes) {
  const DeviceGuard device(ordinal_);
  void* memory = nullptr;
  STICTION_CUDA_TRY(cudaMalloc(&memory, bytes));
  return memory;
}
void CudaApi::release(void* memory) noexcept {
  cudaFree(memory);
}
void* CudaApi::allocate_pinned(std::size_t bytes) {
  const DeviceGuard device(ordinal_);
  void* memory = nullptr;
  STICTION_CUDA_TRY(cudaMallocHost(&memory, bytes));
  return memory;
}
void CudaApi::release_pinned(void* memory) noexcept {
  cudaFreeHost(memory);
}

StreamHandle CudaApi::create_stream() {
  const DeviceGuard device(ordinal_);
  cudaStream_t stream = nullptr;
  STICTION_CUDA_TRY(cudaStreamCreateWithFlags(&stream, cudaStreamNonBlocking));
  return stream;
}
void CudaApi::destroy_stream(StreamHandle stream) noexcept {
  cudaStreamDestroy(stream_of(stream));
}
EventHandle CudaApi::create_event(EventUse use) {
  const DeviceGuard device(ordinal_);
  cudaEvent_t event = nullptr;
  STICTION_CUDA_TRY(
      cudaEventCreateWithFlags(&event, use == EventUse::timing ? cudaEventDefault : cudaEventDisableTiming));
  return event;
}
void CudaApi::destroy_event(EventHandle event) noexcept {
  cudaEventDestroy(event_of(event));
}

void CudaApi::copy(void* target, const void* source, std::size_t bytes, CopyKind kind, StreamHandle stream) {
  const DeviceGuard device(ordinal_);
  STICTION_CUDA_TRY(cudaMemcpyAsync(target, source, bytes, kind_of(kind), stream_of(stream)));
}
void CudaApi::fill_zero(void* target, std::size_t bytes, StreamHandle stream) {
  const DeviceGuard device(ordinal_);
  STICTION_CUDA_TRY(cudaMemsetAsync(target, 0, bytes, stream_of(stream)));
}

int CudaApi::resident_blocks(const CudaKernel& kernel, int block, std::size_t shared) {
  const std::lock_guard lock(mutex_);
  const auto known = resident_.find({kernel.function, block, shared});
  if (known != resident_.end()) return known->second;
  int blocks = 0;
  STICTION_CUDA_TRY(cudaFuncSetAttribute(kernel.function, cudaFuncAttributeMaxDynamicSharedMemorySize,
                                         static_cast<int>(facts_.shared_bytes)));
  STICTION_CUDA_TRY(cudaOccupancyMaxActiveBlocksPerMultiprocessor(&blocks, kernel.function, block, shared));
  resident_.emplace(std::tuple{kernel.function, block, shared}, blocks);
  return blocks;
}

void CudaApi::prepare(const KernelRef& kernel, const LaunchShape& shape) {
  const DeviceGuard device(ordinal_);
  const auto& program = *static_cast<const CudaKernel*>(kernel.entry);
  const LaunchGrid grid = launch_grid(shape_on(shape, facts_.is_whole), program.serial, facts_, grid_memory_);
  resident_blocks(program, grid.block, grid.shared);
  grow_stacks(kernel, grid);
}

/// A kernel whose stack is larger than any before makes the driver take more memory for all of them, and wait for the
/// device. A launch of no team has that behind it before a solve.
void CudaApi::grow_stacks(const KernelRef& kernel, const LaunchGrid& grid) {
  const auto& program = *static_cast<const CudaKernel*>(kernel.entry);
  {
    const std::lock_guard lock(mutex_);
    if (!launched_.insert(program.function).second) return;
  }
  const std::vector<std::byte> nothing(kernel.argument_bytes);
  CudaShape shape = grid.shape;
  shape.teams = 0;
  void* parameters[] = {const_cast<std::byte*>(nothing.data()), &shape};
  cudaStream_t stream = nullptr;
  STICTION_CUDA_TRY(cudaStreamCreateWithFlags(&stream, cudaStreamNonBlocking));
  const cudaError_t queued = cudaLaunchKernel(program.function, dim3(1), dim3(static_cast<unsigned>(grid.width)),
                                              parameters, grid.shared, stream);
  const cudaError_t done = cudaStreamSynchronize(stream);
  cudaStreamDestroy(stream);
  STICTION_CUDA_TRY(queued);
  STICTION_CUDA_TRY(done);
}

void CudaApi::launch(const KernelRef& kernel, const LaunchShape& asked, const void* arguments, StreamHandle stream) {
  if (asked.teams == 0) return;
  const DeviceGuard device(ordinal_);
  const LaunchShape shape = shape_on(asked, facts_.is_whole);
  const auto& program = *static_cast<const CudaKernel*>(kernel.entry);
  if (shape.whole_device && !program.may_be_grid)
    throw Error(ErrorCode::device_failure, std::string(kernel.name) + " has no team of a whole device");
  LaunchGrid grid = launch_grid(shape, program.serial, facts_, grid_memory_);
  const Offset resident = Offset{facts_.processors} * resident_blocks(program, grid.block, grid.shared);
  void* parameters[] = {const_cast<void*>(arguments), &grid.shape};
  cudaLaunchAttribute attribute = cooperative();
  cudaLaunchConfig_t config{};
  config.gridDim = dim3(static_cast<unsigned>(blocks_of(shape, grid, resident)));
  config.blockDim = dim3(static_cast<unsigned>(grid.width), static_cast<unsigned>(grid.block / grid.width));
  config.dynamicSmemBytes = grid.shared;
  config.stream = stream_of(stream);
  config.attrs = &attribute;
  config.numAttrs = shape.whole_device ? 1 : 0;
  if (!shape.whole_device) {
    STICTION_CUDA_TRY(cudaLaunchKernelExC(&config, program.function, parameters));
    return;
  }
  WholeDeviceTurn turn(ordinal_, config.stream, !capturing(stream));
  STICTION_CUDA_TRY(cudaLaunchKernelExC(&config, program.function, parameters));
  turn.pass_on();
}

void CudaApi::record(EventHandle event, StreamHandle stream) {
  const DeviceGuard device(ordinal_);
  STICTION_CUDA_TRY(cudaEventRecord(event_of(event), stream_of(stream)));
}
void CudaApi::wait(StreamHandle stream, EventHandle event) {
  const DeviceGuard device(ordinal_);
  STICTION_CUDA_TRY(cudaStreamWaitEvent(stream_of(stream), event_of(event), 0));
}
void CudaApi::conditionally(const Offset* condition, StreamHandle stream, StreamHandle inner,
                            const std::function<void(StreamHandle)>& body) {
  const DeviceGuard device(ordinal_);
  if (has_conditions_ && capturing(stream))
    capture_conditionally(condition, stream_of(stream), stream_of(inner), [&] { body(inner); });
  else
    body(stream);
}
bool CudaApi::capturing(StreamHandle stream) {
  const DeviceGuard device(ordinal_);
  cudaStreamCaptureStatus status = cudaStreamCaptureStatusNone;
  STICTION_CUDA_TRY(cudaStreamIsCapturing(stream_of(stream), &status));
  return status != cudaStreamCaptureStatusNone;
}
void CudaApi::synchronize(StreamHandle stream) {
  const DeviceGuard device(ordinal_);
  STICTION_CUDA_TRY(cudaStreamSynchronize(stream_of(stream)));
}
void CudaApi::await(EventHandle event) {
  STICTION_CUDA_TRY(cudaEventSynchronize(event_of(event)));
}

std::optional<double> CudaApi::microseconds(EventHandle from, EventHandle to) {
  const DeviceGuard device(ordinal_);
  float milliseconds = 0;
  const cudaError_t error = cudaEventElapsedTime(&milliseconds, event_of(from), event_of(to));
  if (error == cudaErrorNotReady) {
    cudaGetLastError();
    return std::nullopt;
  }
  STICTION_CUDA_TRY(error);
  return 1000.0 * static_cast<double>(milliseconds);
}

void CudaApi::push_range(const char* name) noexcept {
  nvtxRangePushA(name);
}
void CudaApi::pop_range() noexcept {
  nvtxRangePop();
}

}  // namespace stiction::cuda
