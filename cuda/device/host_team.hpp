#pragma once

#include <pthread.h>

#include <atomic>
#include <cstddef>
#include <cstring>
#include <type_traits>
#include <vector>

#include "core/block/reduce.hpp"
#include "cuda/device/kernel.hpp"

namespace stiction::cuda {

/// A barrier whose waiters sleep: with more lanes than cores, waiters that spin would take the turns of those awaited.
class SleepingBarrier {
 public:
  explicit SleepingBarrier(int lanes) { pthread_barrier_init(&barrier_, nullptr, static_cast<unsigned>(lanes)); }
  ~SleepingBarrier() { pthread_barrier_destroy(&barrier_); }
  SleepingBarrier(const SleepingBarrier&) = delete;
  SleepingBarrier& operator=(const SleepingBarrier&) = delete;
  void arrive_and_wait() { pthread_barrier_wait(&barrier_); }

 private:
  pthread_barrier_t barrier_{};
};

/// What the lanes of a host team share.
struct HostTeamMemory {
  explicit HostTeamMemory(int lanes) : width(lanes), barrier(lanes) {
    for (auto& turn : slot) turn.resize(static_cast<std::size_t>(lanes) * kSlotBytes);
  }
  static constexpr std::size_t kSlotBytes = 64;
  int width;
  SleepingBarrier barrier;
  std::vector<std::byte> slot[2];
  alignas(16) std::byte leaves[kReduceLeaves * sizeof(double)] = {};
};

/// A team of the host device: threads that meet at a barrier and at nothing else. It offers what a Block promises and
/// no more, one barrier an exchange as CudaTeam does, so a program with a missing sync races here too.
class HostTeam {
 public:
  static constexpr Index kRowTile = 4;

  HostTeam(HostTeamMemory& memory, int rank) : memory_(&memory), rank_(rank) {}

  [[nodiscard]] Index rank() const { return rank_; }
  [[nodiscard]] Index size() const { return memory_->width; }
  void sync() const {
    if (memory_->width > 1) memory_->barrier.arrive_and_wait();
  }

  template <class F>
  auto broadcast(F&& f) {
    using T = std::remove_cvref_t<decltype(f())>;
    if (memory_->width == 1) return T(f());
    std::byte* const slot = next_slot();
    if (rank_ == 0) put(slot, 0, T(f()));
    sync();
    return get<T>(slot, 0);
  }

  std::uint32_t combine(std::uint32_t bits) {
    return exchange(bits, [](std::uint32_t a, std::uint32_t b) { return a | b; });
  }

  /// The sum of integers over the lanes.
  Index total(Index value) {
    return exchange(value, [](Index a, Index b) { return a + b; });
  }

  template <class T>
  T max(T value) {
    return exchange(value, [](T a, T b) { return max_(a, b); });
  }

  template <class T>
  T* leaves() {
    return reinterpret_cast<T*>(memory_->leaves);
  }

  Offset fetch(Offset* counter, Offset count = 1) {
    return broadcast([&] { return std::atomic_ref(*counter).fetch_add(count); });
  }

 private:
  std::byte* next_slot() {
    turn_ ^= 1;
    return memory_->slot[turn_].data();
  }
  template <class T>
  static void put(std::byte* slot, int lane, const T& value) {
    static_assert(std::is_trivially_copyable_v<T> && sizeof(T) <= HostTeamMemory::kSlotBytes);
    std::memcpy(slot + static_cast<std::size_t>(lane) * HostTeamMemory::kSlotBytes, &value, sizeof(T));
  }
  template <class T>
  static T get(const std::byte* slot, int lane) {
    T value;
    std::memcpy(&value, slot + static_cast<std::size_t>(lane) * HostTeamMemory::kSlotBytes, sizeof(T));
    return value;
  }

  /// Every lane's value joined, on each lane in an order of its own: an operation whose order shows would differ.
  template <class T, class F>
  T exchange(T value, F&& join) {
    if (memory_->width == 1) return value;
    std::byte* const slot = next_slot();
    put(slot, rank_, value);
    sync();
    T joined = value;
    for (int step = 1; step < memory_->width; ++step)
      joined = join(get<T>(slot, (rank_ + step) % memory_->width), joined);
    return joined;
  }

  HostTeamMemory* memory_;
  int rank_;
  int turn_ = 0;
};

}  // namespace stiction::cuda
