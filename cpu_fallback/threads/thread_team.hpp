#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>

#include "core/team/team.hpp"
#include "stiction/types.hpp"

namespace stiction::cpu {

/// A barrier for a few threads that meet often: waiters spin, and give their core away when it takes long. The
/// phase each waits for is the barrier's own count, so it can be used again at once.
class TeamBarrier {
 public:
  explicit TeamBarrier(Index width) : width_(width) {}
  void arrive_and_wait();

 private:
  const Index width_;
  alignas(64) std::atomic<Index> arrived_{0};
  alignas(64) std::atomic<std::uint32_t> phase_{0};
};

/// Memory that the threads of a team share: a barrier, and two sets of slots to exchange values through. Values of one
/// exchange are read until the next one's barrier, while the next one writes the other set.
class ThreadTeam {
 public:
  static constexpr Index kMaxWidth = 256;
  static constexpr std::size_t kLeavesBytes = 32 * sizeof(double);

  explicit ThreadTeam(Index width) : width_(width), barrier_(width) {}
  // Not inline: kernels of every instruction set call them.
  [[nodiscard]] Index width() const;
  void sync();
  [[nodiscard]] unsigned char* slot(int turn, Index rank);
  [[nodiscard]] unsigned char* leaves();
  /// Begins to deal out items 0, 1, ...: every thread calls it.
  void open_deal(Index rank);
  /// The next item for a thread that has ended its last one; `count` or above if none is left. Returns when all items
  /// up to that less `window` have ended.
  [[nodiscard]] Offset take(Index rank, Offset count, Offset window);

 private:
  /// The item that a thread is at, or one that it has ended: all before it are not its own any more.
  struct alignas(64) Place {
    std::atomic<Offset> item{0};
  };

  Index width_;
  TeamBarrier barrier_;
  alignas(64) unsigned char slots_[2 * kMaxWidth * kTeamValueBytes] = {};
  alignas(64) unsigned char leaves_[kLeavesBytes] = {};
  alignas(64) std::atomic<Offset> next_{0};
  Place places_[kMaxWidth];
};

/// Runs work(team, rank) on `threads` threads at once, including the caller's; on fewer if the system gives no more.
/// `work` does not throw. Every thread has the algorithms' floating-point environment.
void run_team(int threads, const std::function<void(ThreadTeam& team, Index rank)>& work);

}  // namespace stiction::cpu
