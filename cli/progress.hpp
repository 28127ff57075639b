#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <string>
#include <thread>

namespace stiction::cli {

/// A progress line on stderr, redrawn at 10 Hz by a separate thread. Drawing hence never slows the work, and a long
/// step still shows a running clock. Draws nothing unless stderr is a terminal. NO_COLOR is respected.
class Progress {
 public:
  /// `total` steps are ahead; 0: unknown, only the clock is shown.
  Progress(std::string label, std::int64_t total, bool quiet);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void advance(std::int64_t steps = 1) { done_.fetch_add(steps, std::memory_order_relaxed); }
  /// A new label; the clock and the count go on.
  void relabel(std::string label);

 private:
  void draw_until_stopped();
  [[nodiscard]] std::string line(const std::string& label) const;

  using Clock = std::chrono::steady_clock;
  Clock::time_point start_ = Clock::now();
  std::int64_t total_;
  std::atomic<std::int64_t> done_{0};
  std::mutex mutex_;
  std::condition_variable wake_;
  std::string label_;  // guarded by mutex_
  bool stop_ = false;  // guarded by mutex_
  bool colour_ = false;
  std::thread thread_;  // not joinable: nothing is drawn
};

}  // namespace stiction::cli
