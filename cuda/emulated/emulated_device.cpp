#include "cuda/emulated/emulated_device.hpp"

#include <dlfcn.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <new>
#include <numeric>
#include <string>

#include "core/base/extents.hpp"
#include "cuda/api/memory.hpp"
#include "cuda/emulated/emulated_kernels.hpp"
#include "cuda/emulated/emulated_launch.hpp"
#include "cuda/emulated/emulated_robots.hpp"
#include "cuda/emulated/guarded_memory.hpp"
#include "stiction/error.hpp"

namespace stiction::cuda {

namespace {

[[noreturn]] void fail(const std::string& what) {
  throw Error(ErrorCode::device_failure, "emulated device: " + what);
}

/// A library of kernels to take in place of this build's; null: none.
const char* other_kernels() {
  return std::getenv("STICTION_EMULATED_KERNELS");
}

/// The kernels of this build, or those of the library that STICTION_EMULATED_KERNELS names: the GPU's own code,
/// executed by the CPU (tests/ptx). `name`: of the library's function that returns them.
template <class Kernels>
const Kernels& choose_kernels(const Kernels& (*of_this_build)(), const char* name) {
  const char* const path = other_kernels();
  if (path == nullptr) return of_this_build();
  void* const library = dlopen(path, RTLD_NOW);
  if (library == nullptr) fail(std::string("STICTION_EMULATED_KERNELS: ") + dlerror());
  using Make = const Kernels* (*)();
  const auto make = reinterpret_cast<Make>(dlsym(library, name));
  if (make == nullptr) fail(std::string("STICTION_EMULATED_KERNELS: ") + dlerror());
  return *make();
}

}  // namespace

std::shared_ptr<EmulatedDevice> shared_emulated_device() {
  static std::mutex mutex;
  static std::weak_ptr<EmulatedDevice> shared;
  const std::lock_guard lock(mutex);
  std::shared_ptr<EmulatedDevice> device = shared.lock();
  if (device == nullptr) shared = device = std::make_shared<EmulatedDevice>();
  return device;
}

EmulatedDevice::EmulatedDevice(const EmulatedDeviceOptions& options) : options_(options), random_(options.seed) {
  facts_ = {"emulated by the CPU", 4, options.shared_bytes, options.shared_bytes + 1024, 0, options.is_whole};
  streams_[nullptr] = std::make_unique<EmulatedStream>();
}

EmulatedDevice::~EmulatedDevice() {
  for (const auto& [memory, bytes] : memory_) std::free(memory);
}

const KernelCatalogue& EmulatedDevice::kernels() const {
  static const KernelCatalogue& chosen = choose_kernels(emulated_kernels, "stiction_emulated_kernels");
  return chosen;
}
const RobotKernels& EmulatedDevice::robot_kernels() const {
  static const RobotKernels& chosen = choose_kernels(emulated_robot_kernels, "stiction_emulated_robot_kernels");
  return chosen;
}

void EmulatedDevice::count(DeviceCall call, const char* what) {
  const int index = static_cast<int>(call);
  ++calls_[index];
  if (fail_at_[index] < 0) return;
  --fail_at_[index];
  if (fail_at_[index] >= 0) return;
  const std::string message = std::string("emulated device: ") + what + " was told to fail";
  throw Error(call == DeviceCall::allocate ? ErrorCode::out_of_memory : ErrorCode::device_failure, message);
}

void EmulatedDevice::fail_call(DeviceCall call, int n) {
  const std::lock_guard lock(mutex_);
  fail_at_[static_cast<int>(call)] = n;
}

Offset EmulatedDevice::pick(Offset count) {
  return options_.seed == 0 ? 0 : static_cast<Offset>(random_() % static_cast<std::uint64_t>(count));
}

void* EmulatedDevice::allocate(std::size_t bytes) {
  const std::lock_guard lock(mutex_);
  for (const auto& [handle, stream] : streams_)
    if (stream->capture != nullptr) fail("an allocation while a stream is captured");
  count(DeviceCall::allocate, "an allocation");
  const std::size_t rounded = padded_bytes(bytes);
  void* memory = other_kernels() != nullptr ? allocate_guarded(rounded) : std::aligned_alloc(kDeviceAlignment, rounded);
  if (memory == nullptr)
    throw Error(ErrorCode::out_of_memory, "emulated device: " + std::to_string(bytes) + " bytes cannot be had");
  // Contents that a program must not rely on, equal in every run.
  std::memset(memory, 0x5a, rounded);
  memory_[memory] = bytes;
  return memory;
}

void EmulatedDevice::release(void* memory) noexcept {
  const std::lock_guard lock(mutex_);
  const auto found = memory_.find(memory);
  if (found == memory_.end()) return;
  if (other_kernels() != nullptr) {
    release_guarded(memory, padded_bytes(found->second));
  } else {
    std::free(memory);
  }
  memory_.erase(found);
}

StreamHandle EmulatedDevice::create_stream() {
  const std::lock_guard lock(mutex_);
  count(DeviceCall::create, "making a stream");
  auto stream = std::make_unique<EmulatedStream>();
  StreamHandle handle = stream.get();
  streams_[handle] = std::move(stream);
  return handle;
}

void EmulatedDevice::destroy_stream(StreamHandle stream) noexcept {
  const std::lock_guard lock(mutex_);
  if (stream != nullptr) streams_.erase(stream);
}

EventHandle EmulatedDevice::create_event(EventUse use) {
  const std::lock_guard lock(mutex_);
  count(DeviceCall::create, "making an event");
  auto event = std::make_unique<EmulatedEvent>();
  event->use = use;
  EventHandle handle = event.get();
  events_[handle] = std::move(event);
  return handle;
}

void EmulatedDevice::destroy_event(EventHandle event) noexcept {
  const std::lock_guard lock(mutex_);
  events_.erase(event);
}

EmulatedDevice::EmulatedStream& EmulatedDevice::stream_of(StreamHandle stream) {
  const auto found = streams_.find(stream);
  if (found == streams_.end()) fail("a stream that is not there");
  return *found->second;
}

EmulatedDevice::EmulatedEvent& EmulatedDevice::event_of(EventHandle event) {
  const auto found = events_.find(event);
  if (found == events_.end()) fail("an event that is not there");
  return *found->second;
}

void EmulatedDevice::queue(StreamHandle stream, Step step) {
  EmulatedStream& target = stream_of(stream);
  if (target.capture == nullptr) {
    target.steps.push_back(std::move(step));
    return;
  }
  Graph& graph = *target.capture;
  const auto branch = std::find(graph.streams_.begin(), graph.streams_.end(), &target) - graph.streams_.begin();
  graph.branches_[static_cast<std::size_t>(branch)].push_back(std::move(step));
}

void EmulatedDevice::copy(void* target, const void* source, std::size_t bytes, CopyKind, StreamHandle stream) {
  const std::lock_guard lock(mutex_);
  count(DeviceCall::copy, "a copy");
  queue(stream, {[=] { std::memcpy(target, source, bytes); }});
}

void EmulatedDevice::fill_zero(void* target, std::size_t bytes, StreamHandle stream) {
  const std::lock_guard lock(mutex_);
  count(DeviceCall::copy, "a fill");
  queue(stream, {[=] { std::memset(target, 0, bytes); }});
}

void EmulatedDevice::prepare(const KernelRef& kernel, const LaunchShape& shape) {
  const std::lock_guard lock(mutex_);
  if (kernel.entry == nullptr) fail(std::string("kernel ") + kernel.name + " is not in this library");
  if (!captures_.empty()) fail(std::string("kernel ") + kernel.name + " is prepared while a stream is captured");
  prepared_.insert(prepared(kernel, shape_on(shape, facts_.is_whole)));
}

void EmulatedDevice::launch(const KernelRef& kernel, const LaunchShape& asked, const void* arguments,
                            StreamHandle stream) {
  const std::lock_guard lock(mutex_);
  const LaunchShape shape = shape_on(asked, facts_.is_whole);
  const bool lanes_fit =
      shape.lanes >= 1 && shape.lanes <= kMostLanes && (shape.lanes % kWarp == 0 || kWarp % shape.lanes == 0);
  const bool does_not_fit =
      lanes_fit && shape.shared_bytes > 0 && least_block_bytes(shape.lanes, shape.shared_bytes) > facts_.shared_bytes;
  if (!lanes_fit || shape.teams < 0 || does_not_fit || kernel.argument_bytes > 4096)
    fail(std::string("kernel ") + kernel.name + " cannot be launched with " + std::to_string(shape.lanes) + " lanes, " +
         std::to_string(shape.teams) + " teams and " + std::to_string(shape.shared_bytes) + " bytes of shared memory");
  count(DeviceCall::launch, kernel.name);
  if (shape.teams == 0) return;
  EmulatedLaunch launch{shape,
                        shape.whole_device ? 1 : smaller_of(shape.teams, options_.teams),
                        smaller_of(shape.lanes, options_.lanes),
                        shape.whole_device ? static_cast<int>(options_.teams) : 0,
                        (shape.whole_device || options_.at_any_pace) && options_.seed != 0 ? random_() : 0,
                        shape.shared_bytes,
                        {}};
  launch.order.resize(static_cast<std::size_t>(launch.teams));
  std::iota(launch.order.begin(), launch.order.end(), Offset{0});
  for (Offset k = launch.teams - 1; k > 0; --k)
    if (options_.seed != 0)
      std::swap(launch.order[static_cast<std::size_t>(k)], launch.order[static_cast<std::size_t>(pick(k + 1))]);
  std::vector<std::byte> bytes(kernel.argument_bytes);
  std::memcpy(bytes.data(), arguments, bytes.size());
  const auto* entry = static_cast<const EmulatedKernel*>(kernel.entry);
  if (entry == nullptr) fail(std::string("kernel ") + kernel.name + " is not in this library");
  if (prepared_.insert(prepared(kernel, shape)).second && stream_of(stream).capture != nullptr)
    fail(std::string("kernel ") + kernel.name + " is launched for the first time while its stream is captured");
  queue(stream, {[entry, launch = std::move(launch), bytes = std::move(bytes)] { entry->run(launch, bytes.data()); }});
}

void EmulatedDevice::record(EventHandle event, StreamHandle stream) {
  const std::lock_guard lock(mutex_);
  EmulatedEvent& target = event_of(event);
  target.mark = ++last_mark_;
  target.capture = stream_of(stream).capture;
  if (target.use == EventUse::timing) target.stamp = std::make_shared<Stamp>();
  queue(stream, {{}, target.mark, 0, target.stamp});
}

void EmulatedDevice::wait(StreamHandle stream, EventHandle event) {
  const std::lock_guard lock(mutex_);
  const EmulatedEvent& source = event_of(event);
  EmulatedStream& target = stream_of(stream);
  if (source.mark == 0) return;
  if (source.capture == nullptr && target.capture != nullptr)
    fail("a captured stream waits for an event that was recorded outside the capture");
  if (source.capture != nullptr && target.capture != nullptr && source.capture != target.capture)
    fail("a captured stream waits for an event of another capture");
  if (source.capture != nullptr && target.capture == nullptr) {
    if (captures_.count(source.capture) == 0) fail("an event of a capture that has ended");
    target.capture = source.capture;
    Graph& graph = *source.capture;
    graph.streams_.push_back(&target);
    graph.branches_.emplace_back();
  }
  queue(stream, {{}, 0, source.mark});
}

bool EmulatedDevice::capturing(StreamHandle stream) {
  const std::lock_guard lock(mutex_);
  return stream_of(stream).capture != nullptr;
}

void EmulatedDevice::run_one_step() {
  std::vector<EmulatedStream*> ready;
  for (const auto& [handle, candidate] : streams_)
    if (!candidate->steps.empty()) {
      const Step& step = candidate->steps.front();
      if (step.after == 0 || marks_.count(step.after) > 0) ready.push_back(candidate.get());
    }
  if (ready.empty()) fail("every stream waits for another");
  EmulatedStream& chosen = *ready[static_cast<std::size_t>(pick(static_cast<Offset>(ready.size())))];
  const Step step = std::move(chosen.steps.front());
  chosen.steps.pop_front();
  if (step.work) step.work();
  if (step.set != 0) marks_.insert(step.set);
  if (step.stamp) *step.stamp = std::chrono::steady_clock::now();
}

void EmulatedDevice::begin_wait() {
  try {
    count(DeviceCall::synchronize, "a synchronisation");
  } catch (...) {
    for (const auto& [handle, lost] : streams_) {
      for (const Step& step : lost->steps)
        if (step.set != 0) marks_.insert(step.set);
      lost->steps.clear();
    }
    throw;
  }
}

void EmulatedDevice::synchronize(StreamHandle stream) {
  const std::lock_guard lock(mutex_);
  const EmulatedStream& target = stream_of(stream);
  if (target.capture != nullptr) fail("a synchronisation of a stream that is being captured");
  begin_wait();
  while (!target.steps.empty()) run_one_step();
}

void EmulatedDevice::await(EventHandle event) {
  const std::lock_guard lock(mutex_);
  const EmulatedEvent& target = event_of(event);
  if (target.capture != nullptr) fail("a synchronisation with an event that is being captured");
  begin_wait();
  while (target.mark != 0 && marks_.count(target.mark) == 0) run_one_step();
}

std::optional<double> EmulatedDevice::microseconds(EventHandle from, EventHandle to) {
  const std::lock_guard lock(mutex_);
  const EmulatedEvent &first = event_of(from), &second = event_of(to);
  if (!first.stamp || !second.stamp) fail("the time of an event that was never recorded, or not made for timing");
  if (!*first.stamp || !*second.stamp) return std::nullopt;
  return std::chrono::duration<double, std::micro>(**second.stamp - **first.stamp).count();
}

void EmulatedDevice::begin_capture(StreamHandle stream) {
  const std::lock_guard lock(mutex_);
  EmulatedStream& origin = stream_of(stream);
  if (origin.capture != nullptr) fail("a stream that is captured already");
  auto graph = std::make_unique<Graph>();
  graph->origin_ = &origin;
  graph->streams_.push_back(&origin);
  graph->branches_.emplace_back();
  origin.capture = graph.get();
  captures_[origin.capture] = std::move(graph);
}

std::shared_ptr<const EmulatedDevice::Graph> EmulatedDevice::drop_capture(StreamHandle stream) {
  const std::lock_guard lock(mutex_);
  EmulatedStream& origin = stream_of(stream);
  if (origin.capture == nullptr || origin.capture->origin_ != &origin) fail("no capture began on this stream");
  Graph* const key = origin.capture;
  std::shared_ptr<const Graph> graph = std::move(captures_.at(key));
  captures_.erase(key);
  for (EmulatedStream* member : graph->streams_) member->capture = nullptr;
  return graph;
}

std::shared_ptr<const EmulatedDevice::Graph> EmulatedDevice::end_capture(StreamHandle stream) {
  std::shared_ptr<const Graph> graph = drop_capture(stream);
  std::set<std::uint64_t> joined;
  for (const Step& step : graph->branches_.front()) joined.insert(step.after);
  for (std::size_t k = 1; k < graph->branches_.size(); ++k)
    if (const std::uint64_t last = graph->branches_[k].back().set; last == 0 || joined.count(last) == 0)
      fail("a stream that joined the capture was not joined back");
  return graph;
}

std::shared_ptr<const EmulatedDevice::Graph> EmulatedDevice::capture(StreamHandle stream,
                                                                     const std::function<void(StreamHandle)>& body) {
  begin_capture(stream);
  try {
    body(stream);
  } catch (...) {
    drop_capture(stream);
    throw;
  }
  return end_capture(stream);
}

void EmulatedDevice::conditionally(const Offset* condition, StreamHandle stream, StreamHandle inner,
                                   const std::function<void(StreamHandle)>& body) {
  if (!capturing(stream)) {
    body(stream);
    return;
  }
  const std::shared_ptr<const Graph> graph = capture(inner, body);
  const std::lock_guard lock(mutex_);
  count(DeviceCall::launch, "a condition");
  queue(stream, {[this, condition, graph] {
          if (*condition != 0) run(*graph);
        }});
}

void EmulatedDevice::run(const Graph& graph) {
  std::set<std::uint64_t> set;
  std::vector<std::size_t> next(graph.branches_.size(), 0);
  for (;;) {
    std::vector<std::size_t> ready;
    for (std::size_t k = 0; k < next.size(); ++k) {
      if (next[k] == graph.branches_[k].size()) continue;
      const std::uint64_t after = graph.branches_[k][next[k]].after;
      if (after == 0 || set.count(after) > 0) ready.push_back(k);
    }
    if (ready.empty()) break;
    const std::size_t k = ready[static_cast<std::size_t>(pick(static_cast<Offset>(ready.size())))];
    const Step& step = graph.branches_[k][next[k]++];
    if (step.work) step.work();
    if (step.set != 0) set.insert(step.set);
  }
}

void EmulatedDevice::launch(const std::shared_ptr<const Graph>& graph, StreamHandle stream) {
  const std::lock_guard lock(mutex_);
  count(DeviceCall::launch, "a graph");
  queue(stream, {[this, graph] { run(*graph); }});
}

}  // namespace stiction::cuda
