#pragma once

#include <chrono>
#include <vector>

#include "stiction/thread_meter.hpp"

namespace stiction::cpu {

/// A section that a meter measures: it begins and ends with this object, on the thread that shares the work out.
class Section {
 public:
  using Clock = std::chrono::steady_clock;

  /// The meter that a section of this thread belongs to; null without one, and within a section.
  static ThreadMeter* meter() noexcept;

  Section(ThreadMeter& meter, int threads);
  ~Section();
  Section(const Section&) = delete;
  Section& operator=(const Section&) = delete;

  /// Adds work of one thread that began at `start` and ends now, less its waits. A thread of its own place calls it;
  /// different places do not meet.
  void worked(int place, Clock::time_point start, Clock::duration waited = {});

 private:
  /// Threads write to lines of their own.
  struct alignas(64) Place {
    Clock::duration busy{};
    Clock::time_point left;
  };

  ThreadMeter& meter_;
  std::vector<Place> places_;
  const Clock::time_point begin_ = Clock::now();
};

}  // namespace stiction::cpu
