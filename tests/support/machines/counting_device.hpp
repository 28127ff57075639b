#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include "cuda/emulated/emulated_device.hpp"
#include "cuda/native/launch_grid.hpp"

namespace stiction::test {

/// Facts that launches depend on (NVIDIA, "CUDA C++ Programming Guide", technical specifications by compute
/// capability). An H100 is as an H200.
struct Gpu {
  const char* name;
  int processors;                ///< multiprocessors
  std::size_t block, processor;  ///< fast memory of a block and of a multiprocessor [KiB]
  int warps;                     ///< of a multiprocessor, at most
};
constexpr Gpu kGpus[] = {{"H200", 132, 227, 228, 64}, {"A100", 108, 163, 164, 64}, {"RTX 4090", 128, 99, 100, 48}};

/// Queues nothing, and checks its launches.
class CountingDevice final : public cuda::DeviceApi {
 public:
  explicit CountingDevice(const Gpu& gpu) : gpu_(gpu) {
    facts_ = {gpu.name, gpu.processors, gpu.block << 10U, gpu.processor << 10U};
  }
  [[nodiscard]] const cuda::DeviceFacts& facts() const override { return facts_; }
  [[nodiscard]] const cuda::KernelCatalogue& kernels() const override { return emulated_.kernels(); }
  [[nodiscard]] const cuda::RobotKernels& robot_kernels() const override { return emulated_.robot_kernels(); }
  void* allocate(std::size_t bytes) override {
    allocated += bytes;
    return this;
  }
  void release(void*) noexcept override {}
  void* allocate_pinned(std::size_t) override { return this; }
  void release_pinned(void*) noexcept override {}
  cuda::StreamHandle create_stream() override { return this; }
  void destroy_stream(cuda::StreamHandle) noexcept override {}
  cuda::EventHandle create_event(cuda::EventUse) override { return this; }
  void destroy_event(cuda::EventHandle) noexcept override {}
  void copy(void*, const void*, std::size_t, cuda::CopyKind, cuda::StreamHandle) override {}
  void fill_zero(void*, std::size_t, cuda::StreamHandle) override { ++fills; }
  void prepare(const cuda::KernelRef& kernel, const cuda::LaunchShape& shape) override {
    ASSERT_NE(kernel.entry, nullptr) << kernel.name;
    prepared.insert(what_counts(kernel, shape));
  }
  void launch(const cuda::KernelRef& kernel, const cuda::LaunchShape& shape, const void* given,
              cuda::StreamHandle) override {
    ++launches;
    const auto* const bytes = static_cast<const std::byte*>(given);
    arguments.assign(bytes, bytes + kernel.argument_bytes);
    shapes.emplace(kernel.name, shape);  // the first of its name
    EXPECT_EQ(prepared.count(what_counts(kernel, shape)), 1U) << kernel.name << " could not be captured";
    std::size_t& most = shared[kernel.entry];
    most = std::max(most, shape.shared_bytes);
    const cuda::LaunchGrid grid = cuda::launch_grid(shape, shape.lanes == 1, facts_, nullptr);
    EXPECT_LE(grid.shared, facts_.shared_bytes) << kernel.name << ", " << shape.lanes << " lanes, " << gpu_.name;
    EXPECT_EQ(grid.block % cuda::kWarp, 0);
    EXPECT_LE(grid.block, cuda::kMostLanes);
  }
  void record(cuda::EventHandle, cuda::StreamHandle) override {}
  void wait(cuda::StreamHandle, cuda::EventHandle) override {}
  void conditionally(const Offset*, cuda::StreamHandle stream, cuda::StreamHandle inner,
                     const std::function<void(cuda::StreamHandle)>& body) override {
    if (!is_capturing) {
      body(stream);
      return;
    }
    const int before = launches;
    body(inner);
    conditional_launches += launches - before;
    launches = before;
    ++conditions;
  }
  bool capturing(cuda::StreamHandle) override { return is_capturing; }
  void synchronize(cuda::StreamHandle) override {}
  void await(cuda::EventHandle) override {}
  std::optional<double> microseconds(cuda::EventHandle, cuda::EventHandle) override { return std::nullopt; }

  bool is_capturing = false;     ///< whether streams report a capture
  int launches = 0;              ///< that are behind no condition
  int conditional_launches = 0;  ///< that are
  int conditions = 0;
  int fills = 0;
  std::size_t allocated = 0;         ///< memory of the device, freed or not [byte]
  std::vector<std::byte> arguments;  ///< of the last launch
  std::set<std::tuple<const void*, int, std::size_t, bool>> prepared;
  std::map<std::string, cuda::LaunchShape> shapes;  ///< of the first launch of each kernel, by name
  std::map<const void*, std::size_t> shared;        ///< most fast memory that teams of a kernel asked for [byte]

 private:
  static std::tuple<const void*, int, std::size_t, bool> what_counts(const cuda::KernelRef& kernel,
                                                                     const cuda::LaunchShape& shape) {
    return {kernel.entry, shape.lanes, shape.shared_bytes, shape.whole_device};
  }

  Gpu gpu_;
  cuda::DeviceFacts facts_;
  cuda::EmulatedDevice emulated_;  ///< has a catalogue of kernels
};

}  // namespace stiction::test
