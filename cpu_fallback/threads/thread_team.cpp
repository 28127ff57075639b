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

/// Looks of a waiter at the phase before it yields, which takes some hundred microseconds. On a busy machine a yield
/// costs whole turns of all others, at every barrier.
constexpr int kSpins = 4000;

using Clock = Section::Clock;

/// Time that this thread has waited at its team's barriers; null without a meter.
thread_local Clock::duration* waited_here = nullptr;

void pause() {
#if defined(__x86_64__) || defined(__i386__)
  __builtin_ia32_pause();
#elif defined(__aarch64__)
  asm volatile("yield");
#endif
}

/// Returns once is_reached().
template <class F>
void spin_until(F&& is_reached) {
  for (int spins = 0; !is_reached(); ++spins) {
    if (spins < kSpins) {
      pause();
    } else {
      std::this_thread::yield();
    }
  }
}

/// wait(), which a meter hears of.
template <class F>
void metered(F&& wait) {
  if (waited_here == nullptr) return wait();
  const Clock::time_point start = Clock::now();
  wait();
  *waited_here += Clock::now() - start;
}

}  // namespace

void TeamBarrier::arrive_and_wait() {
  const std::uint32_t phase = phase_.load(std::memory_order_relaxed);
  if (arrived_.fetch_add(1, std::memory_order_acq_rel) + 1 == width_) {
    arrived_.store(0, std::memory_order_relaxed);
    phase_.store(phase + 1, std::memory_order_release);
    return;
  }
  spin_until([&] { return phase_.load(std::memory_order_acquire) != phase; });
}

Index ThreadTeam::width() const {
  return width_;
}

void ThreadTeam::sync() {
  metered([&] { barrier_.arrive_and_wait(); });
}

void ThreadTeam::open_deal(Index rank) {
  places_[rank].item.store(0, std::memory_order_relaxed);
  if (rank == 0) next_.store(0, std::memory_order_relaxed);
  sync();
}

Offset ThreadTeam::take(Index rank, Offset count, Offset window) {
  const Offset item = next_.fetch_add(1, std::memory_order_relaxed);
  // A thread that sees this one go on sees its writes in its last item.
  places_[rank].item.store(item, std::memory_order_release);
  const auto has_gone_on = [&](Index other) {
    return places_[other].item.load(std::memory_order_acquire) > item - window;
  };
  Index other = 0;
  const auto all_have = [&] {
    while (other < width_ && has_gone_on(other)) ++other;
    return other == width_;
  };
  if (item < count && !all_have()) metered([&] { spin_until(all_have); });
  return item;
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
