#pragma once

#include <condition_variable>
#include <mutex>
#include <string>
#include <thread>

namespace stiction::distributed {

/// Ends the job when the work of a scope takes longer than a rank may wait for another. For calls of all ranks that
/// know no deadline.
class DeadlineGuard {
 public:
  /// `what`: the ranks' work, in words.
  DeadlineGuard(int rank, double seconds, std::string what);
  ~DeadlineGuard();
  DeadlineGuard(const DeadlineGuard&) = delete;
  DeadlineGuard& operator=(const DeadlineGuard&) = delete;

 private:
  void watch(int rank, double seconds, const std::string& what);
  std::mutex mutex_;
  std::condition_variable ended_;
  bool has_ended_ = false;
  std::thread thread_;
};

}  // namespace stiction::distributed
