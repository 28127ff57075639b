#pragma once

#include <pthread.h>

#include <cstddef>
#include <cstring>
#include <thread>
#include <type_traits>
#include <vector>

#include "core/block/reduce.hpp"

/// A GPU block on the CPU: real threads that meet at a barrier and at nothing else. It offers what the concept promises
/// and no more (one barrier an exchange, as CudaBlock does), so that a body with a missing sync races here too.
namespace stiction::test {

/// A barrier whose waiters sleep. std::barrier's spin and yield, and with more lanes than cores on a busy machine each
/// yield waits for everybody else's turn.
class SleepingBarrier {
 public:
  explicit SleepingBarrier(Index lanes) { pthread_barrier_init(&barrier_, nullptr, static_cast<unsigned>(lanes)); }
  ~SleepingBarrier() { pthread_barrier_destroy(&barrier_); }
  SleepingBarrier(const SleepingBarrier&) = delete;
  SleepingBarrier& operator=(const SleepingBarrier&) = delete;
  void arrive_and_wait() { pthread_barrier_wait(&barrier_); }

 private:
  pthread_barrier_t barrier_{};
};

/// What the lanes of a torture block share.
struct TortureTeam {
  explicit TortureTeam(Index lanes) : width(lanes), barrier(lanes) {
    for (auto& turn : slot) turn.resize(static_cast<std::size_t>(lanes) * kSlotBytes);
  }
  static constexpr std::size_t kSlotBytes = 64;
  Index width;
  SleepingBarrier barrier;
  std::vector<std::byte> slot[2];
  alignas(16) std::byte leaves[kReduceLeaves * sizeof(double)] = {};
};

template <Index kTile>
class TortureBlock {
 public:
  static constexpr Index kRowTile = kTile;

  TortureBlock(TortureTeam& team, Index rank) : team_(&team), rank_(rank) {}

  [[nodiscard]] Index rank() const { return rank_; }
  [[nodiscard]] Index size() const { return team_->width; }
  void sync() { team_->barrier.arrive_and_wait(); }

  template <class F>
  auto broadcast(F&& f) {
    using T = std::remove_cvref_t<decltype(f())>;
    std::byte* const slot = next_slot();
    if (rank_ == 0) put(slot, 0, f());
    sync();
    return get<T>(slot, 0);
  }

  std::uint32_t combine(std::uint32_t bits) {
    return exchange(bits, [](std::uint32_t a, std::uint32_t b) { return a | b; });
  }

  template <class T>
  T max(T value) {
    return exchange(value, [](T a, T b) { return max_(a, b); });
  }

  template <class T>
  T* leaves() {
    return reinterpret_cast<T*>(team_->leaves);
  }

 private:
  std::byte* next_slot() {
    turn_ ^= 1;
    return team_->slot[turn_].data();
  }
  template <class T>
  static void put(std::byte* slot, Index lane, const T& value) {
    static_assert(std::is_trivially_copyable_v<T> && sizeof(T) <= TortureTeam::kSlotBytes);
    std::memcpy(slot + static_cast<std::size_t>(lane) * TortureTeam::kSlotBytes, &value, sizeof(T));
  }
  template <class T>
  static T get(const std::byte* slot, Index lane) {
    T value;
    std::memcpy(&value, slot + static_cast<std::size_t>(lane) * TortureTeam::kSlotBytes, sizeof(T));
    return value;
  }

  /// Every lane's value joined, on each lane in an order of its own: an operation whose order shows would differ.
  template <class T, class F>
  T exchange(T value, F&& join) {
    std::byte* const slot = next_slot();
    put(slot, rank_, value);
    sync();
    T joined = value;
    for (Index step = 1; step < team_->width; ++step)
      joined = join(get<T>(slot, (rank_ + step) % team_->width), joined);
    return joined;
  }

  TortureTeam* team_;
  Index rank_;
  int turn_ = 0;
};

/// Runs f(block) on each of `width` threads, on the block that make(team, rank) gives it.
template <class Make, class F>
void run_block(Index width, Make&& make, F&& f) {
  TortureTeam team(width);
  std::vector<std::thread> threads;
  for (Index rank = 0; rank < width; ++rank)
    threads.emplace_back([&, rank] {
      auto block = make(team, rank);
      f(block);
    });
  for (std::thread& thread : threads) thread.join();
}

/// Runs f(block) on a TortureBlock of `width` threads.
template <Index kTile, class F>
void run_block(Index width, F&& f) {
  run_block(
      width, [](TortureTeam& team, Index rank) { return TortureBlock<kTile>(team, rank); }, f);
}

}  // namespace stiction::test
