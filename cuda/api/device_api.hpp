#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cuda/api/kernel.hpp"

namespace stiction::cuda {

struct KernelCatalogue;
struct RobotKernels;

/// cudaStream_t and cudaEvent_t, without their header.
using StreamHandle = void*;
using EventHandle = void*;

/// Facts about a device by which the engine sizes its launches.
struct DeviceFacts {
  std::string name;
  int processors = 1;                     ///< multiprocessors: that many blocks at least run at once
  std::size_t shared_bytes = 0;           ///< most shared memory a block may ask for
  std::size_t resident_shared_bytes = 0;  ///< shared memory of one multiprocessor
  std::size_t memory_bytes = 0;           ///< of the device; 0: not known
  bool is_whole = true;                   ///< no other process has a part of it: launches of the whole device are real
};

/// Events order work; those that also record the time cost the device a little more.
enum class EventUse : unsigned char { ordering, timing };

enum class CopyKind : unsigned char { to_device, to_host, on_device };

/// Everything the CUDA machine asks of a device: memory, streams, launches. There are two: the CUDA runtime, and an
/// emulated device. The latter runs the same launches on the CPU, in any order the streams and events allow, and can
/// be made to fail. Every call either does its work or throws Error(out_of_memory) or Error(device_failure) and has
/// done nothing.
///
/// Memory is allocated and freed outside of solves only, so neither is ordered by a stream: the caller waits first.
class DeviceApi {
 public:
  DeviceApi() = default;
  DeviceApi(const DeviceApi&) = delete;
  DeviceApi& operator=(const DeviceApi&) = delete;
  virtual ~DeviceApi() = default;

  [[nodiscard]] virtual const DeviceFacts& facts() const = 0;
  /// The kernels, compiled for this device.
  [[nodiscard]] virtual const KernelCatalogue& kernels() const = 0;
  [[nodiscard]] virtual const RobotKernels& robot_kernels() const = 0;

  virtual void* allocate(std::size_t bytes) = 0;
  virtual void release(void* memory) noexcept = 0;
  /// Host memory that copies reach without a detour.
  virtual void* allocate_pinned(std::size_t bytes) = 0;
  virtual void release_pinned(void* memory) noexcept = 0;

  virtual StreamHandle create_stream() = 0;
  virtual void destroy_stream(StreamHandle stream) noexcept = 0;
  virtual EventHandle create_event(EventUse use) = 0;
  virtual void destroy_event(EventHandle event) noexcept = 0;

  /// Calls below are queued on a stream and done in its order.
  virtual void copy(void* target, const void* source, std::size_t bytes, CopyKind kind, StreamHandle stream) = 0;
  virtual void fill_zero(void* target, std::size_t bytes, StreamHandle stream) = 0;
  /// Loads a kernel, and looks up how many of its blocks run at once, for launches of this shape with any number of
  /// teams. launch() then only queues. A kernel's first launch of a shape does the same, but must not be captured: to
  /// load code a device may have to wait.
  virtual void prepare(const KernelRef& kernel, const LaunchShape& shape) = 0;
  /// `arguments` are copied; they are kernel.argument_bytes long.
  virtual void launch(const KernelRef& kernel, const LaunchShape& shape, const void* arguments,
                      StreamHandle stream) = 0;
  virtual void record(EventHandle event, StreamHandle stream) = 0;
  /// `stream` goes on once the work last recorded in `event` is done.
  virtual void wait(StreamHandle stream, EventHandle event) = 0;

  /// Calls `body`, which queues work on the stream that it is given. If `stream` is being captured, that is `inner`.
  /// The graph then does the work in the order of `stream`, and leaves it out if the integer at `condition` is 0 by
  /// then. Otherwise it is `stream`, and all is done. `inner` has nothing else to do.
  virtual void conditionally(const Offset* condition, StreamHandle stream, StreamHandle inner,
                             const std::function<void(StreamHandle)>& body) = 0;

  /// Returns true if `stream` is being captured into a graph: then nothing may allocate or wait.
  virtual bool capturing(StreamHandle stream) = 0;
  /// Returns when all work on the stream is done. \throws the error of that work, if it failed.
  virtual void synchronize(StreamHandle stream) = 0;
  /// Returns when the work last recorded in the event is done.
  virtual void await(EventHandle event) = 0;

  /// Time from one timing event to another, as last recorded; nothing while either is not done.
  virtual std::optional<double> microseconds(EventHandle from, EventHandle to) = 0;

  /// Marks a range of host work for a profiler.
  virtual void push_range(const char*) noexcept {}
  virtual void pop_range() noexcept {}
};

}  // namespace stiction::cuda
