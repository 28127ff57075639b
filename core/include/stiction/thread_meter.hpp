#pragma once

/// \file
/// Times of the CPU's threads in solves: they work, or wait for one another (docs/howto/threads.md).

#include <vector>

namespace stiction {

class Tracer;

/// Use of threads in sections. A section is work that is shared out to threads and ends when all of it is done.
struct ThreadUse {
  double seconds = 0;        ///< that sections took, one after the other [s]
  double available = 0;      ///< time that all threads of the sections had, at work or not [s]
  std::vector<double> busy;  ///< time at work by place in a section, the caller's first [s]  (threads)

  /// Share of the available time that was not work: threads waited at barriers, for a section to begin or to end. 0
  /// without sections.
  [[nodiscard]] double synchronisation_share() const noexcept;
  /// Largest of the busy times over their mean; 1 is even. 1 without sections.
  [[nodiscard]] double imbalance() const noexcept;

  /// Takes in sections that were measured apart, threads by their place.
  ThreadUse& operator+=(const ThreadUse& more);
};

/// Measures the sections of whatever its thread calls while it lives; of several, the last one made. Sections within
/// sections are work of the outer one. Measuring takes two reads of the clock for an item and for a barrier, and
/// reaches no bit. Without a meter nothing is read.
class ThreadMeter {
 public:
  /// Begins to measure. `tracer` is given spans "wait" of the threads' waits at ends of sections; null: none.
  explicit ThreadMeter(Tracer* tracer = nullptr) noexcept;
  /// Ends it. The thread that made the meter destroys it.
  ~ThreadMeter();
  ThreadMeter(const ThreadMeter&) = delete;
  ThreadMeter& operator=(const ThreadMeter&) = delete;

  /// Returns the measurements so far.
  [[nodiscard]] const ThreadUse& use() const noexcept { return use_; }

  /// The meter of the calling thread, null without one. Called by code that shares work out.
  [[nodiscard]] static ThreadMeter* current() noexcept;
  /// Takes in a section of so many seconds, and the busy times of its threads. Called by code that shares work out.
  void add(double seconds, std::vector<double> busy);
  /// Returns the tracer that gets spans; null: none.
  [[nodiscard]] Tracer* tracer() const noexcept { return tracer_; }

 private:
  Tracer* const tracer_;
  ThreadMeter* const outer_;
  ThreadUse use_;
};

}  // namespace stiction
