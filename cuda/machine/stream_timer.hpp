#pragma once

#include <memory>
#include <vector>

#include "cuda/api/memory.hpp"
#include "stiction/trace.hpp"

namespace stiction::cuda {

/// A range of host work, for a profiler.
class ProfilerRange {
 public:
  ProfilerRange(DeviceApi& api, const char* name) : api_(api) { api_.push_range(name); }
  ~ProfilerRange() { api_.pop_range(); }
  ProfilerRange(const ProfilerRange&) = delete;
  ProfilerRange& operator=(const ProfilerRange&) = delete;

 private:
  DeviceApi& api_;
};

/// Times the work queued on a device's streams, by an event before and one behind. Hands the spans to a tracer once
/// they are done. Without a tracer nothing is queued and nothing made.
class StreamTimer {
 public:
  explicit StreamTimer(DeviceApi& api) : api_(api) {}

  /// Times work queued from now on for `tracer`. It is not timed at all if that is null, or while a stream is
  /// captured: a graph has no duration.
  void attach(Tracer* tracer, bool capturing);

  /// Calls `queue` inside a profiler's range and two events. Texts live as long as the program.
  template <class Queue>
  void time(const char* name, const char* detail, int lane, StreamHandle stream, Queue&& queue) {
    const ProfilerRange range(api_, name);
    if (tracer_ == nullptr) return queue();
    Timed* const timed = begin(name, detail, lane, stream);
    queue();
    if (timed == nullptr) return;
    api_.record(timed->end.get(), stream);
    timed->complete = true;
  }

  /// Hands over spans that are done by now, without waiting. Times that a lost device does not give are left out.
  void collect() noexcept;

 private:
  static constexpr std::size_t kMostPending = 4096;
  struct Timed {
    explicit Timed(DeviceApi& api) : begin(api, EventUse::timing), end(api, EventUse::timing) {}
    Event begin, end;
    Span span;
    bool complete = false;  ///< its end was queued too
  };

  Timed* begin(const char* name, const char* detail, int lane, StreamHandle stream);
  /// The device's and the tracer's clock, looked at together.
  void set_zero();
  /// Returns true if the span is off our hands.
  [[nodiscard]] bool export_spans(const Timed& timed);

  DeviceApi& api_;
  Tracer* tracer_ = nullptr;  ///< null: queued work is not timed
  Tracer* owner_ = nullptr;   ///< whose the pending spans are
  std::unique_ptr<Stream> stream_;
  std::unique_ptr<Event> zero_;
  double zero_time_ = 0;  ///< when zero_ happened, on the tracer's clock [us]
  std::vector<std::unique_ptr<Timed>> pending_, unused_;
};

}  // namespace stiction::cuda
