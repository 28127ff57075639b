#pragma once

#include <cuda_runtime_api.h>

#include <map>
#include <mutex>
#include <set>
#include <tuple>

#include "cuda/api/device_api.hpp"
#include "cuda/native/cuda_kernel.hpp"
#include "cuda/native/launch_grid.hpp"

namespace stiction::cuda {

/// The CUDA runtime behind DeviceApi: one GPU.
class CudaApi final : public DeviceApi {
 public:
  /// \throws Error(device_failure) if the device does not answer.
  explicit CudaApi(int ordinal);
  ~CudaApi() override;

  [[nodiscard]] const DeviceFacts& facts() const override { return facts_; }
  [[nodiscard]] const KernelCatalogue& kernels() const override;
  [[nodiscard]] const RobotKernels& robot_kernels() const override;
  void* allocate(std::size_t bytes) override;
  void release(void* memory) noexcept override;
  void* allocate_pinned(std::size_t bytes) override;
  void release_pinned(void* memory) noexcept override;
  StreamHandle create_stream() override;
  void destroy_stream(StreamHandle stream) noexcept override;
  EventHandle create_event(EventUse use) override;
  void destroy_event(EventHandle event) noexcept override;
  void copy(void* target, const void* source, std::size_t bytes, CopyKind kind, StreamHandle stream) override;
  void fill_zero(void* target, std::size_t bytes, StreamHandle stream) override;
  void prepare(const KernelRef& kernel, const LaunchShape& shape) override;
  void launch(const KernelRef& kernel, const LaunchShape& asked, const void* arguments, StreamHandle stream) override;
  void record(EventHandle event, StreamHandle stream) override;
  void wait(StreamHandle stream, EventHandle event) override;
  void conditionally(const Offset* condition, StreamHandle stream, StreamHandle inner,
                     const std::function<void(StreamHandle)>& body) override;
  bool capturing(StreamHandle stream) override;
  void synchronize(StreamHandle stream) override;
  void await(EventHandle event) override;
  std::optional<double> microseconds(EventHandle from, EventHandle to) override;
  void push_range(const char* name) noexcept override;
  void pop_range() noexcept override;

 private:
  /// Blocks of a kernel that one multiprocessor runs at once.
  int resident_blocks(const CudaKernel& kernel, int block, std::size_t shared);
  void grow_stacks(const KernelRef& kernel, const LaunchGrid& grid);

  int ordinal_;
  DeviceFacts facts_;
  bool has_conditions_ = false;  ///< graphs can leave work out
  void* grid_memory_ = nullptr;
  std::mutex mutex_;
  std::map<std::tuple<const void*, int, std::size_t>, int> resident_;
  std::set<const void*> launched_;  ///< functions whose stacks are allocated
};

}  // namespace stiction::cuda
