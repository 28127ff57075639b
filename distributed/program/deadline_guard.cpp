#include "distributed/program/deadline_guard.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "distributed/program/commands.hpp"
#include "distributed/program/give_up.hpp"

namespace stiction::distributed {

DeadlineGuard::DeadlineGuard(int rank, double seconds, std::string what)
    : thread_([this, rank, seconds, what = std::move(what)] { watch(rank, seconds, what); }) {}

DeadlineGuard::~DeadlineGuard() {
  {
    const std::lock_guard lock(mutex_);
    has_ended_ = true;
  }
  ended_.notify_one();
  thread_.join();
}

void DeadlineGuard::watch(int rank, double seconds, const std::string& what) {
  constexpr double kLongest = 1e9;  // limit of the clock
  std::unique_lock lock(mutex_);
  if (ended_.wait_for(lock, std::chrono::duration<double>(std::min(seconds, kLongest)), [&] { return has_ended_; }))
    return;
  give_up(
      rank,
      fmt::format("a rank has not answered within the deadline of {:g} s while {}; the job ends here, start it again",
                  seconds, what),
      kExitRankLost);
}

}  // namespace stiction::distributed
