#include "cpu_fallback/threads/thread_team.hpp"

#include <algorithm>
#include <memory>
#include <optional>
#include <system_error>
#include <thread>
#include <vector>

#include "core/base/extents.hpp"
#include "core/base/fp_env.hpp"
#include "cpu_fallback/threads/section.hpp"

namespace stiction::cpu {

namespace {

/// How often a waiter looks at the phase before it yields, which takes some hundred microseconds. On a busy machine a
/// yield costs whole turns of all others, at every barrier.
constexpr int kSpins = 4000;

using Clock = Section::Clock;

/// What this thread has waited at its team's barriers; null without a meter.
thread_local Clock::duration* waited_here = nullptr;

void pause() {
#if defined(__x86_64__) || defined(__i386__)
  __builtin_ia32_pause();
#elif defined(__aarch64__)
  asm volatile("yield");
#endif
}

}  // namespace

void TeamBarrier::arrive_and_wait() {
  const std::uint32_t phase = phase_.load(std::memory_order_relaxed);
  if (arrived_.fetch_add(1, std::memory_order_acq_rel) + 1 == width_) {
    arrived_.store(0, std::memory_order_relaxed);
    phase_.store(phase + 1, std::memory_order_release);
    return;
  }
  int spins = 0;
  while (phase_.load(std::memory_order_acquire) == phase) {
    if (++spins < kSpins) {
      pause();
    } else {
      std::this_thread::yield();
    }
  }
}

Index ThreadTeam::width() const {
  return width_;
}

void ThreadTeam::sync() {
  if (waited_here == nullptr) return barrier_.arrive_and_wait();
  const Clock::time_point start = Clock::now();
  barrier_.arrive_and_wait();
  *waited_here += Clock::now() - start;
}

unsigned char* ThreadTeam::slot(int turn, Index rank) {
  return slots_ + (static_cast<std::size_t>(turn) * kMaxWidth + static_cast<std::size_t>(rank)) * kTeamValueBytes;
}

unsigned char* ThreadTeam::leaves() {
  return leaves_;
}

void run_team(int threads, const std::function<void(ThreadTeam& team, Index rank)>& work) {
  const Index wanted = bounded<Index>(threads, 1, ThreadTeam::kMaxWidth);
  std::unique_ptr<ThreadTeam> team;
  std::atomic<bool> formed{false};
  std::optional<Section> section;
  if (ThreadMeter* const meter = Section::meter()) section.emplace(*meter, wanted);
  const auto run = [&](Index rank) {
    formed.wait(false);
    const ScopedFpEnv fp_env;
    if (!section) return work(*team, rank);
    Clock::duration waited{};
    const Clock::time_point start = Clock::now();
    waited_here = &waited;
    work(*team, rank);
    waited_here = nullptr;
    section->worked(rank, start, waited);
  };
  std::vector<std::thread> others;
  others.reserve(static_cast<std::size_t>(wanted));
  try {
    for (Index rank = 1; rank < wanted; ++rank) others.emplace_back(run, rank);
  } catch (const std::system_error&) {
    // The team is as wide as it got: no result depends on that.
  }
  team = std::make_unique<ThreadTeam>(static_cast<Index>(others.size()) + 1);
  formed.store(true);
  formed.notify_all();
  run(0);
  for (std::thread& thread : others) thread.join();
}

}  // namespace stiction::cpu
