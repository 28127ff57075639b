#pragma once

/// \file
/// Spans of time in solves (docs/howto/tracing.md).

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <string>
#include <vector>

namespace stiction {

/// Whose time a span took.
enum class SpanPlace : std::uint8_t {
  host = 0,    ///< the CPU's
  device = 1,  ///< a device's
};

/// A piece of work that was timed. Its texts live as long as the program.
struct Span {
  const char* name = "";              ///< which work: "solve", "plan", ... (docs/howto/tracing.md)
  const char* detail = nullptr;       ///< which kernel, which class of environments; may be null
  SpanPlace place = SpanPlace::host;  ///< the CPU, or work queued on a device
  int lane = 0;                       ///< thread of a solve (0: the caller's), or stream of the device
  std::int64_t environments = -1;     ///< number of items it was about, -1: unknown
  double start = 0;                   ///< since the tracer was made [us]
  double duration = 0;                ///< [us]
};

/// Collects where the time of solves goes (docs/howto/tracing.md): put one into SolverOptions::tracer. Any thread may
/// add to it. It holds so many spans and counts the others. Looking at the time reaches no bit of an answer.
class Tracer {
 public:
  /// A tracer with room for that many spans.
  explicit Tracer(std::size_t capacity = std::size_t{1} << 16);

  /// Time since this tracer was made [us].
  [[nodiscard]] double now() const noexcept;
  /// Takes a span in, or counts it where there is no room.
  void add(const Span& span) noexcept;
  /// Says that so many spans could not be timed.
  void leave_out(std::size_t count) noexcept;

  /// Returns the collected spans, by start. Spans of a device come in when its work is waited for
  /// (Solver::synchronize, or a solve of a host batch). The last ones come in when the solver is destroyed.
  [[nodiscard]] std::vector<Span> spans() const;
  /// Spans for which there was no room.
  [[nodiscard]] std::size_t left_out() const;
  /// Writes the spans as a JSON array of complete events, as chrome://tracing and Perfetto read it. Host threads are
  /// those of process 0, streams of the device those of process 1.
  [[nodiscard]] std::string chrome_json() const;

 private:
  using Clock = std::chrono::steady_clock;
  const Clock::time_point made_ = Clock::now();
  const std::size_t capacity_;
  mutable std::mutex mutex_;
  std::vector<Span> spans_;   // guarded by mutex_, room for capacity_ from the beginning
  std::size_t left_out_ = 0;  // guarded by mutex_
};

/// Times its own life on the host. With a null tracer it costs one test of a pointer.
class ScopedSpan {
 public:
  /// Begins a span; arguments as in Span. A null tracer: nothing is timed.
  ScopedSpan(Tracer* tracer, const char* name, const char* detail = nullptr, int lane = 0,
             std::int64_t environments = -1) noexcept
      : tracer_(tracer), span_{name, detail, SpanPlace::host, lane, environments, 0, 0} {
    if (tracer_ != nullptr) span_.start = tracer_->now();
  }
  ~ScopedSpan() {
    if (tracer_ == nullptr) return;
    span_.duration = tracer_->now() - span_.start;
    tracer_->add(span_);
  }
  ScopedSpan(const ScopedSpan&) = delete;
  ScopedSpan& operator=(const ScopedSpan&) = delete;

 private:
  Tracer* tracer_;
  Span span_;
};

}  // namespace stiction
