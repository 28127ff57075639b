#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <random>
#include <set>
#include <tuple>
#include <vector>

#include "cuda/api/device_api.hpp"

namespace stiction::cuda {

/// Calls that an emulated device can be made to fail at.
enum class DeviceCall : unsigned char { allocate, copy, launch, synchronize, create };
inline constexpr int kDeviceCalls = 5;

struct EmulatedDeviceOptions {
  int lanes = 2;           ///< threads of a team, at most; a team that asks for fewer lanes gets fewer
  Offset teams = 3;        ///< teams that "run at once", so that programs must take several items each. Also blocks
                           ///< of the team that is the whole device, which do run at once
  std::uint64_t seed = 0;  ///< order of streams and teams, speed of a whole device's lanes; 0: as queued, all alike
  std::size_t shared_bytes = std::size_t{227} << 10;  ///< fast memory of a team, at most
  bool is_whole = true;                               ///< DeviceFacts::is_whole
  bool at_any_pace = false;                           ///< lanes of every team differ in speed, if there is a seed
};

/// A device without a GPU: the engine's launches, copies and events, carried out by threads of the CPU. Nothing is done
/// before it is waited for, and then in any order that streams and events allow, drawn from a seed. A missing
/// dependency hence shows as a wrong result. Captures streams into graphs by CUDA's rules. The n-th call of a kind can
/// be made to fail.
class EmulatedDevice final : public DeviceApi {
 public:
  explicit EmulatedDevice(const EmulatedDeviceOptions& options = {});
  ~EmulatedDevice() override;

  [[nodiscard]] const DeviceFacts& facts() const override { return facts_; }
  [[nodiscard]] const KernelCatalogue& kernels() const override;
  [[nodiscard]] const RobotKernels& robot_kernels() const override;
  void* allocate(std::size_t bytes) override;
  void release(void* memory) noexcept override;
  void* allocate_pinned(std::size_t bytes) override { return allocate(bytes); }
  void release_pinned(void* memory) noexcept override { release(memory); }
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

  /// Captured work; may be launched any number of times.
  class Graph;
  /// Work queued on `stream` from now on, and on streams that wait for it, becomes part of a graph.
  void begin_capture(StreamHandle stream);
  /// \throws Error(device_failure) if a stream that joined the capture was not joined back.
  std::shared_ptr<const Graph> end_capture(StreamHandle stream);
  void launch(const std::shared_ptr<const Graph>& graph, StreamHandle stream);

  /// The n-th call from now of that kind fails (0: the next one); negative: none does.
  void fail_call(DeviceCall call, int n);
  /// Calls of that kind so far.
  [[nodiscard]] int calls(DeviceCall call) const { return calls_[static_cast<int>(call)]; }
  /// Allocations that are not released.
  [[nodiscard]] std::size_t live_allocations() const { return memory_.size(); }
  [[nodiscard]] std::size_t live_handles() const { return streams_.size() + events_.size() - 1; }

 private:
  /// When a recorded event happened; nothing until then.
  using Stamp = std::optional<std::chrono::steady_clock::time_point>;

  /// A point of a stream: work, or a mark set, or a mark waited for.
  struct Step {
    std::function<void()> work;
    std::uint64_t set = 0;    ///< mark that this step sets, 0: none
    std::uint64_t after = 0;  ///< mark that must be set before, 0: none
    /// set when the step is done, if it is timed
    std::shared_ptr<Stamp> stamp = nullptr;
  };
  struct EmulatedStream {
    std::deque<Step> steps;
    Graph* capture = nullptr;
  };
  struct EmulatedEvent {
    std::uint64_t mark = 0;    ///< last recorded; 0: never
    Graph* capture = nullptr;  ///< the capture it was recorded in, if any
    EventUse use = EventUse::ordering;
    std::shared_ptr<Stamp> stamp = nullptr;  ///< of the last time it was recorded
  };

  /// Key of a prepared kernel: all of a shape but the number of teams.
  using Prepared = std::tuple<const void*, int, std::size_t, bool>;
  static Prepared prepared(const KernelRef& kernel, const LaunchShape& shape) {
    return {kernel.entry, shape.lanes, shape.shared_bytes, shape.whole_device};
  }

  EmulatedStream& stream_of(StreamHandle stream);
  EmulatedEvent& event_of(EventHandle event);
  void queue(StreamHandle stream, Step step);
  /// Ends a capture, whether all that joined it was joined back or not.
  std::shared_ptr<const Graph> drop_capture(StreamHandle stream);
  /// Captures the work that `body` queues on `stream`.
  std::shared_ptr<const Graph> capture(StreamHandle stream, const std::function<void(StreamHandle)>& body);
  /// Runs all of a graph, in an order that its streams and events allow.
  void run(const Graph& graph);
  /// Runs one step of some stream, drawn from those that are free to go on.
  void run_one_step();
  /// Counts a synchronisation; if it is to fail, the device is lost and nothing queued is ever done.
  void begin_wait();
  void count(DeviceCall call, const char* what);
  Offset pick(Offset count);

  EmulatedDeviceOptions options_;
  DeviceFacts facts_;
  mutable std::mutex mutex_;
  std::mt19937_64 random_;
  std::map<void*, std::size_t> memory_;
  std::map<StreamHandle, std::unique_ptr<EmulatedStream>> streams_;  ///< nullptr: the default stream
  std::map<EventHandle, std::unique_ptr<EmulatedEvent>> events_;
  std::map<Graph*, std::unique_ptr<Graph>> captures_;  ///< under way
  std::set<std::uint64_t> marks_;                      ///< set so far
  std::set<Prepared> prepared_;
  std::uint64_t last_mark_ = 0;
  int calls_[kDeviceCalls] = {};
  int fail_at_[kDeviceCalls] = {-1, -1, -1, -1, -1};
};

/// The device that Device::emulated() stands for: one for the process, as a GPU is, while it is in use.
std::shared_ptr<EmulatedDevice> shared_emulated_device();

class EmulatedDevice::Graph {
 private:
  friend class EmulatedDevice;
  EmulatedStream* origin_ = nullptr;
  std::vector<EmulatedStream*> streams_;     ///< that take part, the origin first
  std::vector<std::vector<Step>> branches_;  ///< steps of each, marks counted within the graph
};

}  // namespace stiction::cuda
